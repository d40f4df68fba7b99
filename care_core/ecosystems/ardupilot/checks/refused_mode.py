"""A mission that was asked for and never began: the firmware refused Auto, and it was never in it."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.timeline import counted
from care_core.ecosystems.vehicles.errors import FLIGHT_MODE
from care_core.ecosystems.vehicles.modes import mode_name
from care_core.logs.base import Wanted
from care_core.metadata.causal_map import NO_CAUSE, Sign, meaning_of
from care_core.run import shown

READS: Wanted = {}
LIMITS = Limits()
_LASTS_S = LIMITS.add("time over which it is refused again and again", 10.0, "s", "a choice: a pilot tries it once")
_SETTING_P = LIMITS.add("probability of a parameter that its estimate reads", 0.6, "", "a choice: a sensor may lack")
_UNKNOWN_P = LIMITS.add("probability of how it is set up, where none is off", 0.3, "", "a choice: a sensor may lack")
_KEPT_P = LIMITS.add("probability that no mission is flown so", 1.0, "", "it is not begun")
_MISSION = "Auto"
_SAID_S = 0.5
_REFUSES = "Mode change"
"""How the firmware begins to say why it refuses a mode ("Mode change failed: ", "Mode change to AUTO failed: ")."""
_POSITION: frozenset[Sign] = frozenset(("position", "estimator"))
_MOST = 3
"""Where more are off than so many, none of them is named."""


def find(flight: Flight) -> Iterator[Finding]:
    """The refusals that no mission followed."""
    times = [t for t, code in flight.errors(FLIGHT_MODE) if mode_name(flight.mode_kind, code) == _MISSION]
    if not times or not flight.armed or any(mode.way == "mission" for mode in flight.modes):
        return
    lasted, why = times[-1] - times[0] >= _LASTS_S, _reason(flight, times[-1])
    named = _off(flight) if "position" in why else ()
    values = "".join(f"; {text}" for _, text in named)
    yield Finding(
        kind="estimator" if "position" in why else "commands",
        title=f"{_MISSION} was refused to the end{f': {why}' if why else ''}",
        onset_s=times[0],
        end_s=times[-1],
        severity="critical" if lasted else "warning",
        evidence=f"{counted(len(times), 'refusal')}, and it was never in {_MISSION}{values}",
        source="ERR 10, MSG",
        suspect="parameter",
        probability=_SETTING_P if named else _UNKNOWN_P,
        mission_lost=_KEPT_P,
        parameters=tuple(name for name, _ in named),
    )


def _reason(flight: Flight, t: float) -> str:
    """Why, by the text beside the last refusal; empty where the log has none."""
    said = [text for _, text in flight.messages_between(t - _SAID_S, t + _SAID_S) if text.startswith(_REFUSES)]
    return said[-1].partition(": ")[2] if said else ""


def _off(flight: Flight) -> tuple[tuple[str, str], ...]:
    """The few parameters that an estimate of position goes by and that are off their defaults, with what they are."""
    found = []
    for name in flight.settings:
        default, meaning = flight.default_left(name), meaning_of(name, flight.kind)
        if default is None or meaning is None or meaning.role in NO_CAUSE or not meaning.signs & _POSITION:
            continue
        found.append((name, f"{name} is {shown(flight.settings[name][0].value)} (default {shown(default)})"))
    return tuple(found) if len(found) <= _MOST else ()


CHECK = Check("refused mode", "Auto that the firmware refused to the end of the log", READS, LIMITS, find)

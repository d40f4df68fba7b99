"""Loss of the radio or of the ground station, as the firmware's failsafes saw it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.heartbeat import shown_failsafes
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding, Severity
from care_core.ecosystems.spans import within
from care_core.ecosystems.vehicles.errors import GCS_FAILSAFE, RADIO_FAILSAFE
from care_core.logs.base import Wanted
from care_core.text import log_time

READS: Wanted = {"RCIN": ("C3",)}

_LINKS = {RADIO_FAILSAFE: "the radio link was lost", GCS_FAILSAFE: "the ground station link was lost"}
_WORDS = {RADIO_FAILSAFE: ("radio failsafe", "throttle failsafe"), GCS_FAILSAFE: ("gcs failsafe",)}
_BEFORE_ARMING = ("radio failsafe", "throttle below failsafe", "rc not", "manual control", "pilot input")
"""What a vehicle says of its radio before it is armed, and as it loses it."""
_REASONS = {RADIO_FAILSAFE: 3, GCS_FAILSAFE: 5}
"""Why a mode was entered (ModeReason.h)."""
LIMITS = Limits()
_BRIEF_S = LIMITS.add(
    "loss that explains no crash", 1.0, "s", "a choice: a failsafe that is over so soon has moved nothing far"
)
_LOST_P = LIMITS.add("probability of a lost link", 0.8, "", "the firmware's own word")
_TOLD_S = LIMITS.add(
    "text of a failsafe behind the disarming by it", 0.5, "s", "a choice: texts wait for a link, heartbeats do not"
)
_NO_PULSE = LIMITS.add("pulse of a throttle without a transmitter", 975.0, "us", "FS_THR_VALUE as shipped")
_NO_SIGNAL = LIMITS.add("pulse that is none", 500.0, "us", "receivers send 800 to 2200; 0 is no receiver")
_BRIEF_P = LIMITS.add("probability of a brief loss", 0.3, "", "a choice: links drop frames now and then")


def find(flight: Flight) -> Iterator[Finding]:
    """Each link with how long it was gone; one that came back within a second, before its failsafe did anything, does
    not explain a crash."""
    for subsystem, title in _LINKS.items():
        told = flight.errors(subsystem)
        gone = [t for t, code in told if code > 0]
        gone += [t for t, text in flight.messages if text.casefold().startswith(_WORDS[subsystem]) and
                 "clear" not in text.casefold()]  # fmt: skip
        watched = [(start, stop + _TOLD_S) for start, stop in flight.watched]
        gone = sorted(t for t in gone if within(watched, t))
        if not gone:
            yield from _by_heartbeat(flight) if subsystem == RADIO_FAILSAFE else ()
            continue
        back = [t for t, code in told if code == 0 and t > gone[0]]
        end = back[0] if back else max(flight.watched[-1][1], gone[0])
        away = end - gone[0]
        is_brief = away < _BRIEF_S and not _acted(flight, subsystem, gone[0])
        severity: Severity = "warning" if is_brief or subsystem == GCS_FAILSAFE else "critical"
        if not flight.armed:
            severity = "info"  # a transmitter that is switched off on the ground
        yield Finding(
            kind="radio",
            title=title,
            onset_s=gone[0],
            end_s=end,
            severity=severity,
            evidence=f"failsafe at {log_time(gone[0])}, " + (f"back after {away:.1f} s" if back else "not back"),
            source=f"ERR {subsystem}",
            suspect="world",
            probability=_BRIEF_P if is_brief else _LOST_P,
        )


def _by_heartbeat(flight: Flight) -> Iterator[Finding]:
    """A radio failsafe that the heartbeat alone tells of: by what kept it from arming before, or its throttle's pulse
    below what a transmitter sends."""
    least = flight.setting("FS_THR_VALUE", "THR_FS_VALUE") or _NO_PULSE
    for (start, end), words in shown_failsafes(flight):
        pulses = flight.one("RCIN", "C3")
        sent = np.empty(0) if pulses is None else pulses["C3"][(pulses.t >= start) & (pulses.t <= end)]
        pulse = float(np.median(sent)) if len(sent) else np.nan
        is_low = _NO_SIGNAL < pulse < least
        if not is_low and not any(word in words.casefold() for word in _BEFORE_ARMING):
            continue
        low = f"; the throttle's pulse is {pulse:.0f} us, below the {least:g} of FS_THR_VALUE" if is_low else ""
        yield Finding(
            kind="radio",
            title=_LINKS[RADIO_FAILSAFE],
            onset_s=start,
            end_s=end,
            severity="critical",
            evidence=f"{words} for {end - start:.0f} s{low}",
            source="HEARTBEAT, RC_CHANNELS",
            suspect="world",
            probability=_LOST_P,
        )
        return


def _acted(flight: Flight, subsystem: int, since_s: float) -> bool:
    """Whether the failsafe changed the mode: what it broke off it did, however soon the link was back."""
    return any(m.reason == _REASONS[subsystem] and 0 <= m.start_s - since_s < _BRIEF_S for m in flight.modes)


CHECK = Check("radio", "a lost radio or ground station link", READS, LIMITS, find)

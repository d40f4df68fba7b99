"""A rover whose steering or throttle acts the wrong way round, and one that waits to be set off.

A rover records what it asks of its steering and its throttle before its outputs turn them round, and how it then turns
and drives: with the right signs of both, what is asked and what is done agree.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.statistics import lasting
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.spans import Span, during
from care_core.logs.base import Table, Wanted
from care_core.metadata.ardupilot import firmware_default
from care_core.metadata.output_functions import LEFT, RIGHT, STEERING, THROTTLE
from care_core.numbers import Bools

READS: Wanted = {"THR": ("ThrOut", "DesSpeed", "Speed"), "STER": ("SteerOut", "TurnRate")}

LIMITS = Limits()
_MOVES_MS = LIMITS.add("speed of a rover that drives", 0.5, "m/s", "a choice: above the noise of the estimate")
_ASKS = LIMITS.add("least throttle", 5.0, "%", "Rover/crash_check.cpp")
_LASTS_S = LIMITS.add(
    "time for which it drives against its throttle", 10.0, "s", "a choice: brakes and gusts last less"
)
_STEERS = LIMITS.add("full steering", 0.9, "", "a choice: a share of all that there is")
_RECORDS = LIMITS.add("fewest records of steering", 20.0, "", "a choice: some seconds of driving")
_TURNS_DPS = LIMITS.add("least turning", 0.5, "deg/s", "a choice: above what a gyro wanders by")
_AGAINST = LIMITS.add(
    "correlation of steering and turn rate", -0.7, "", "-0.1 and more in 270 drives, -0.97 of a reversed one"
)
_WAITS_S = LIMITS.add("time for which it waits", 60.0, "s", "a choice: who sets it off walks up to it and pushes")
_SURE_P = LIMITS.add("probability of the parameter", 0.95, "", "no other explains the sign or the wait")

_AUTO = 10
"""Number of the mode that runs missions (Rover/mode.h)."""
_BALANCE_BOT = 3
_SIDES = (LEFT, RIGHT)
_FULL = 4500.0
"""SteerOut of full steering (AR_Motors)."""
_SET_OFF = ("AUTO_KICKSTART", "AUTO_TRIGGER_PIN")
_TURNED = ("AHRS_ORIENTATION", "COMPASS_ORIENT")
"""What turns the vehicle in its own eyes: then no sign tells of the outputs."""


def find(flight: Flight) -> Iterator[Finding]:
    """A throttle or steering that acts the wrong way, and a wait that nobody ends."""
    driven, steered = flight.one("THR", *READS["THR"]), flight.one("STER", *READS["STER"])
    if flight.kind != "rover" or driven is None:
        return
    yield from _waiting(flight, driven)
    if any(_is_off(flight, name) for name in _TURNED):
        return
    yield from _backwards(flight, driven)
    if steered is not None:
        yield from _steered_against(flight, driven, steered)
        yield from _one_wheel_against(flight, driven, steered)


def _waiting(flight: Flight, driven: Table) -> Iterator[Finding]:
    """It stays where it was armed for a push or a switch that never comes."""
    name = next((one for one in _SET_OFF if _is_off(flight, one)), None)
    stands = (np.abs(driven["DesSpeed"]) < _MOVES_MS) & (np.abs(driven["ThrOut"]) < _ASKS)
    waits = stands & _in_mission(flight, driven)
    spans = lasting(driven.t, waits, _WAITS_S)
    has_driven = bool((_in_mission(flight, driven) & ~stands).any())
    if name is not None and spans and not has_driven:
        yield _finding(
            flight, name, _default(flight, name), spans[0], "it waits to be set off",
            f"for {spans[0][1] - spans[0][0]:.0f} s in Auto with no throttle (limit {_WAITS_S:g} s)",
        )  # fmt: skip


def _backwards(flight: Flight, driven: Table) -> Iterator[Finding]:
    """It drives backwards while its throttle, or the speed that it wants, is forwards."""
    moves = np.abs(driven["Speed"]) > _MOVES_MS
    asks = np.abs(driven["ThrOut"]) >= _ASKS
    against = moves & asks & (np.sign(driven["ThrOut"]) != np.sign(driven["Speed"]))
    fleeing = moves & asks & (np.sign(driven["DesSpeed"]) != np.sign(driven["Speed"])) & ~against
    by_itself = flight.drives_itself(driven.t)
    outputs = _outputs(flight, THROTTLE)
    if (spans := lasting(driven.t, by_itself & against, _LASTS_S)) and len(outputs) == 1:
        yield _finding(
            flight, *_reversed(flight, outputs[0]), spans[0], "it drives against its throttle",
            f"for {spans[0][1] - spans[0][0]:.0f} s with throttle and speed of opposite signs (limit {_LASTS_S:g} s)",
        )  # fmt: skip
    is_bot = flight.setting("FRAME_CLASS") == _BALANCE_BOT and _is_off(flight, "FRAME_CLASS")
    wanted = np.abs(driven["DesSpeed"]) > _MOVES_MS
    if is_bot and (spans := lasting(driven.t, by_itself & fleeing & wanted, _LASTS_S)):
        title = "it is driven as a balance bot and runs away"
        shown = f"for {spans[0][1] - spans[0][0]:.0f} s against its wanted speed (limit {_LASTS_S:g} s)"
        yield _finding(flight, "FRAME_CLASS", _default(flight, "FRAME_CLASS"), spans[0], title, shown)


def _steered_against(flight: Flight, driven: Table, steered: Table) -> Iterator[Finding]:
    """It turns left where it steers right."""
    speed = np.interp(steered.t, driven.t, driven["Speed"])
    moves = (speed > _MOVES_MS) & flight.drives_itself(steered.t)
    asked, turned, t = steered["SteerOut"][moves], steered["TurnRate"][moves], steered.t[moves]
    outputs = _outputs(flight, STEERING)
    if len(t) < _RECORDS or len(outputs) != 1 or np.std(turned) < _TURNS_DPS or not np.std(asked):
        return
    agrees = float(np.corrcoef(asked, turned)[0, 1])
    if agrees <= _AGAINST:
        yield _finding(
            flight, *_reversed(flight, outputs[0]), (float(t[0]), float(t[-1])), "it turns against its steering",
            f"correlation of steering and turn rate {agrees:.2f} over {t[-1] - t[0]:.0f} s (limit {_AGAINST:g})",
        )  # fmt: skip


def _one_wheel_against(flight: Flight, driven: Table, steered: Table) -> Iterator[Finding]:
    """A skid-steered rover that drives where it steers, since the wheels of one side turn round: it neither turns nor
    stops. Which side that is, only a parameter tells that was changed."""
    t = driven.t
    steers = np.abs(np.interp(t, steered.t, steered["SteerOut"])) >= _STEERS * _FULL
    turns = np.abs(np.interp(t, steered.t, steered["TurnRate"])) > _TURNS_DPS
    drives = (np.abs(driven["ThrOut"]) < _ASKS) & (np.abs(driven["Speed"]) > _MOVES_MS)
    sides = [f"SERVO{n}_REVERSED" for function in _SIDES for n in _outputs(flight, function)]
    turned = [name for name in sides if _is_off(flight, name)]
    spans = lasting(t, flight.drives_itself(t) & steers & ~turns & drives, _LASTS_S)
    if spans and len(sides) == len(_SIDES) and len(turned) == 1:
        yield _finding(
            flight, turned[0], _default(flight, turned[0]), spans[0], "it drives where it steers",
            f"for {spans[0][1] - spans[0][0]:.0f} s at full steering without a turn, and without throttle at "
            f"{np.max(np.abs(driven['Speed'][during(spans, t)])):.1f} m/s (limit {_LASTS_S:g} s)",
        )  # fmt: skip


def _finding(flight: Flight, name: str, wanted: float | None, span: Span, title: str, shown: str) -> Finding:
    value = flight.setting(name)
    return Finding(
        kind="drive",
        title=title,
        onset_s=span[0],
        end_s=span[1],
        severity="critical",
        evidence=f"{shown}: {name} is {0.0 if value is None else value:g}",
        source="THR, STER; PARM",
        suspect="parameter",
        probability=_SURE_P,
        parameters=(name,),
        wanted=() if wanted is None else ((name, wanted),),
    )


def _in_mission(flight: Flight, driven: Table) -> Bools:
    return np.asarray(flight.drives_itself(driven.t) & (flight.modes_at(driven.t) == _AUTO))


def _outputs(flight: Flight, function: int) -> list[int]:
    """The outputs with a function, the first that it is wired to."""
    return [n for n in range(1, 17) if flight.setting(f"SERVO{n}_FUNCTION") == function]


def _reversed(flight: Flight, output: int) -> tuple[str, float]:
    """The parameter that turns an output round, and its other value."""
    name = f"SERVO{output}_REVERSED"
    return name, 0.0 if flight.setting(name) else 1.0


def _default(flight: Flight, name: str) -> float | None:
    left = flight.default_left(name)
    return firmware_default(name, flight.kind) if left is None else left


def _is_off(flight: Flight, name: str) -> bool:
    value, default = flight.setting(name), _default(flight, name)
    return value is not None and default is not None and value != default


CHECK = Check(
    "driven", "a rover that is driven against its steering or throttle, or waits to be set off", READS, LIMITS, find
)

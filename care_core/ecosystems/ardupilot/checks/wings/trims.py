"""Trims of a plane's surfaces against where it flies straight.

What the autopilot holds ailerons and an elevator at in straight flight is their middle, whatever SERVOn_TRIM says: of
100 simulated planes with right trims the ailerons are held within 2 us of it and the elevator, which trims the speed as
well, within 75 us. The rudder is not held straight by anything: a plane whose rudder is held over flies with a bank, by
0.07 to 0.09 degrees for each microsecond, and by 2.3 degrees at most with a right trim.
"""

from __future__ import annotations

from collections.abc import Iterator

from care_core.ecosystems.ardupilot.checks.wings import straight
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.logs.base import Wanted, merge_needs
from care_core.metadata.output_functions import AILERONS, ELEVATOR, RUDDER
from care_core.numbers import Floats
from care_core.records import Record
from care_core.run import shown

READS: Wanted = merge_needs((straight.READS, {"RCOU": tuple(f"C{n}" for n in range(1, 15))}))
LIMITS = Limits(straight.LIMITS)
_OFF_US = LIMITS.add("trim off its default", 60.0, "us", "what banks a plane by 5 degrees")
_HELD_US = LIMITS.add("trim off where the ailerons are held", 80.0, "us", "2 at most in 100 simulated planes")
_TRIMS_US = LIMITS.add("trim off where the elevator is held", 150.0, "us", "twice the most of these")
_AS_DEFAULT = LIMITS.add("share of it within which the default is meant", 0.5, "", "a choice: an elevator trims, too")
_FAR = LIMITS.add("the same that loses a mission, as a share of the travel", 0.4, "", "a choice: a turn wants the rest")
_BANK_DEG = LIMITS.add("bank of straight flight", 5.0, "deg", "twice what any simulated plane with a right trim has")
_FAR_DEG = LIMITS.add("bank that loses a mission", 20.0, "deg", "2 of 2 simulated planes; one of 15.5 flew its mission")
_SURE_P = LIMITS.add("probability of the trim", 0.9, "", "it is measured")
_LOST_P = LIMITS.add("probability that a smaller one loses the mission", 0.3, "", "a choice: its way is off in turns")

_MIDDLE_US = 1500.0
"""The trim of an output as shipped."""
_HELD = {AILERONS: ("the ailerons", "their"), ELEVATOR: ("the elevator", "its")}
"""Functions of the outputs that the autopilot holds a plane straight with."""
_ENDS_US = (("MIN", 1100.0), ("MAX", 1900.0))
"""Ends of an output as shipped."""


class _Surface(Record):
    """A surface whose trim is off its default, in straight flight."""

    function: int
    output: str
    """Its column of RCOU, C1 and so on."""
    parameter: str
    trim: float
    default: float
    held: float
    """Microseconds."""
    travel: float
    """From its trim as shipped to an end (us)."""
    t: Floats
    """Times of straight flight (s)."""

    @property
    def off_us(self) -> float:
        """By how much the trim is off where the surface is held."""
        return abs(self.held - self.trim)

    @property
    def is_default_meant(self) -> bool:
        """Whether the default is its middle, as far as this shows."""
        return abs(self.held - self.default) <= _AS_DEFAULT * self.off_us


def find(flight: Flight) -> Iterator[Finding]:
    """Surfaces whose trims are not their middles."""
    for surface in _off(flight):
        found = _of_rudder(flight, surface) if surface.function == RUDDER else _of_held(surface)
        if found is not None:
            yield found


def _off(flight: Flight) -> Iterator[_Surface]:
    told = flight.one("RCOU") if flight.is_winged else None
    if told is None:
        return
    t = straight.straight(flight)
    for n in range(1, 15) if len(t) else ():
        function, name = flight.setting(f"SERVO{n}_FUNCTION"), f"SERVO{n}_TRIM"
        trim, default = flight.setting(name), flight.default_left(name)
        if function not in (*_HELD, RUDDER) or f"C{n}" not in told.columns or trim is None:
            continue
        middle = _MIDDLE_US if default is None else default
        if abs(trim - middle) >= _OFF_US:
            low, high = (flight.setting(f"SERVO{n}_{end}") or at for end, at in _ENDS_US)
            held = straight.held_at(t, told, f"C{n}")
            yield _Surface(int(function), f"C{n}", name, trim, middle, held, (high - low) / 2, t)


def _of_held(surface: _Surface) -> Finding | None:
    """Ailerons or an elevator that the autopilot holds off their trim."""
    least = _HELD_US if surface.function == AILERONS else _TRIMS_US
    if surface.off_us < least or not (surface.is_default_meant or surface.function == AILERONS):
        return None
    is_far = surface.off_us > _FAR * surface.travel
    wanted = surface.default if surface.is_default_meant else float(round(surface.held))
    what, whose = _HELD[surface.function]
    evidence = (
        f"in straight flight the output is held at {surface.held:.0f} us, and {_as_set(surface)}: off by "
        f"{surface.off_us:.0f} us (limit {least:g})"
    )
    return _finding(surface, f"the trim of {what} is not {whose} middle", evidence, is_far, wanted, "")


def _of_rudder(flight: Flight, surface: _Surface) -> Finding | None:
    """A rudder that banks the plane."""
    leans = flight.one("ATT", "Roll", "Yaw")
    bank = 0.0 if leans is None else straight.held_at(surface.t, leans, "Roll")
    if abs(bank) < _BANK_DEG or abs(surface.held - surface.default) < _OFF_US:
        return None
    evidence = (
        f"{bank:+.0f} deg of bank in straight flight (limit {_BANK_DEG:g}), with the rudder's output at "
        f"{surface.held:.0f} us: {_as_set(surface)}"
    )
    title = "it flies straight with a bank: the rudder is held over"
    return _finding(surface, title, evidence, abs(bank) > _FAR_DEG, surface.default, "ATT.Roll, ")


def _as_set(surface: _Surface) -> str:
    return f"{surface.parameter} is {shown(surface.trim)} (default {shown(surface.default)})"


def _finding(surface: _Surface, title: str, evidence: str, is_far: bool, wanted: float, measured: str) -> Finding:
    return Finding(
        kind="surface",
        title=title,
        onset_s=float(surface.t[0]),
        end_s=float(surface.t[-1]),
        severity="critical" if is_far else "warning",
        evidence=evidence,
        source=f"{measured}ATT.Yaw, RCOU.{surface.output}",
        suspect="parameter",
        probability=_SURE_P,
        mission_lost=None if is_far else _LOST_P,
        parameters=(surface.parameter,),
        wanted=((surface.parameter, wanted),),
    )


CHECK = Check("trims", "a plane's surfaces whose trims are not where it flies straight", READS, LIMITS, find)

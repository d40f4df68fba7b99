"""A compass that a parameter turns, shifts or scales, and a board that is mounted otherwise than it is told.

What a compass reads is known without it: other compasses read the same field, and a copter speeds up to where it leans,
which the receiver tells (`course`). A parameter that is off its default is wrong where undoing it alone brings the
compass to what it should read. Mounting, offset and scale: AP_Compass_Backend (rotate_field, correct_field).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import permutations

import numpy as np

from care_core.ecosystems.ardupilot.checks.settings import gravity
from care_core.ecosystems.ardupilot.checks.settings.course import Course, Leans
from care_core.ecosystems.ardupilot.checks.settings.rotations import matrix
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.statistics import aligned, length
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.logs.base import Table, Wanted
from care_core.numbers import Floats, median
from care_core.records import Record

_FIELD = ("MagX", "MagY", "MagZ")
_MOTORS = ("MOX", "MOY", "MOZ")
READS: Wanted = {
    "MAG": (*_FIELD, *_MOTORS), "ATT": ("Roll", "Pitch", "Yaw"), "GPS": ("Spd", "GCrs"), "XKF4": ("SM",),
    **gravity.READS,
}  # fmt: skip

LIMITS = Limits()
_APART = LIMITS.add("compass off what it should read", 0.25, "", "a choice: a share of the field; 100 of 400 mGauss")
_REFUSED = LIMITS.add("compass off it that kept the vehicle from arming", 0.1, "", "AP_Arming: 100 mGauss of the field")
_AGREES = LIMITS.add("compass that reads what it should", 0.15, "", "a choice: calibrations differ by less")
_MENDS = LIMITS.add("share of it that undoing leaves", 0.5, "", "a choice: undoing what is to blame mends most of it")
_EXPLAINED = LIMITS.add(
    "share of the speeding up that leans explain", 0.5, "",
    "by it the heading of 268 healthy flights is known within 7 degrees",
)  # fmt: skip
_OFF_DEG = LIMITS.add("heading off the true one", 15.0, "deg", "twice what healthy flights have at most")
_RIGHT_DEG = LIMITS.add("heading that is right", 20.0, "deg", "a choice: mountings are 45 degrees apart")
_TURNED_DEG = LIMITS.add("heading of a compass that is turned", 30.0, "deg", "a choice: mountings are 45 degrees apart")
_BETTER = LIMITS.add(
    "share that another mounting explains more",
    0.15,
    "",
    "a choice: of so many mountings one explains a little more by chance",
)
_UNTOUCHED_S = LIMITS.add(
    "shortest flight that tells against a mounting that nobody changed", 60.0, "s", "a choice: few leans are chance"
)
_SURE_P = LIMITS.add("probability that undoing it mends", 0.95, "", "no other parameter brings the compass back")
_NEAR = LIMITS.add("measured value that is the default", 0.05, "", "a choice: a share of the field")
_FEWEST, _ROUNDED = 3, 0.01
_TILTED = 0.05
"""By how much more a mounting turns down into the side of a board, gravity tells it."""
_FLAT = 16
"""Mountings below this are level, the right way up or upside down."""


class Undone(Record):
    """A parameter that, undone, brings a compass back."""

    parameter: str
    wanted: float
    title: str
    evidence: str


def find(flight: Flight) -> Iterator[Finding]:
    """The parameter that turns, shifts or scales a compass."""
    undone = wrong_setting(flight)
    if undone is not None:
        failed = flight.was_refused or flight.lost_control_s is not None or flight.impact_s is not None
        yield Finding(
            kind="compass",
            title=undone.title,
            onset_s=flight.watched[0][0],
            end_s=flight.end_s,
            severity="critical" if failed else "warning",
            evidence=undone.evidence,
            source="MAG; ATT and GPS for the course",
            suspect="parameter",
            probability=_SURE_P,
            parameters=(undone.parameter,),
            wanted=((undone.parameter, undone.wanted),),
        )


def wrong_setting(flight: Flight) -> Undone | None:
    """The parameter whose undoing brings a compass to what it should read; None where nothing shows one."""
    if flight.setting("COMPASS_ENABLE", "MAG_ENABLE") == 0 or not flight.watched:
        return None
    tables = [table.where(flight.watch(table.t)) for table in flight.all("MAG", *_FIELD)]
    compasses = [_Compass(flight, n, table) for n, table in enumerate(tables, start=1) if len(table) >= _FEWEST]
    return _by_others(compasses) or _by_course(flight, [one for one in compasses if one.is_used])


class _Compass:
    """A compass with what its parameters did to its field, shape (3, n)."""

    def __init__(self, flight: Flight, number: int, table: Table) -> None:
        self.flight, self.number, self.table = flight, number, table
        self.field = np.stack([table[axis] for axis in _FIELD])

    @property
    def _digit(self) -> str:
        return "" if self.number == 1 else str(self.number)

    @property
    def is_used(self) -> bool:
        return self.flight.setting(f"COMPASS_USE{self._digit}") != 0

    @property
    def mounting(self) -> str:
        """The parameter that says how it is mounted: its own, or within the board the board's."""
        return self._mounting(is_outside=bool(self.flight.setting(self._external)))

    @property
    def _external(self) -> str:
        return "COMPASS_EXTERNAL" if self.number == 1 else f"COMPASS_EXTERN{self.number}"

    def _mounting(self, *, is_outside: bool) -> str:
        return f"COMPASS_ORIENT{self._digit}" if is_outside else "AHRS_ORIENTATION"

    def undone(self) -> Iterator[tuple[str, float, Floats]]:
        """Each parameter of it that is off its default: its name, its default, and the field with it undone."""
        mounted = self.flight.default_left(self.mounting)
        if mounted is not None and (field := self.mounted(mounted)) is not None:
            yield self.mounting, mounted, field
        place = self.flight.default_left(self._external)
        if mounted is None and place is not None and (field := self._placed(bool(place))) is not None:
            yield self._external, place, field
        for axis, moved in enumerate(_MOTORS):
            shift, by_motors = (f"COMPASS_{what}{self._digit}_{'XYZ'[axis]}" for what in ("OFS", "MOT"))
            default, value = self.flight.default_left(shift), self.flight.setting(shift)
            if default is not None and value is not None:
                yield shift, default, self._moved(axis, default - value)
            default = self.flight.default_left(by_motors)
            if default is not None and moved in self.table.columns:
                yield by_motors, default, self._moved(axis, -self.table[moved])
        scale = f"COMPASS_SCALE{self._digit}"
        default, value = self.flight.default_left(scale), self.flight.setting(scale)
        if default and value:
            yield scale, default, self.field * default / value

    def mounted(self, number: float) -> Floats | None:
        """The field if it were mounted otherwise; its offsets come after that."""
        before, after = matrix(self.flight.setting(self.mounting) or 0.0), matrix(number)
        if before is None or after is None:
            return None
        shift = np.array([[self.flight.setting(f"COMPASS_OFS{self._digit}_{axis}") or 0.0] for axis in "XYZ"])
        turned: Floats = after @ before.T @ (self.field - shift) + shift
        return turned

    def _placed(self, is_outside: bool) -> Floats | None:
        """The field if it were said to be outside the board, or in it."""
        return self.mounted(self.flight.setting(self._mounting(is_outside=is_outside)) or 0.0)

    def _moved(self, axis: int, by: float | Floats) -> Floats:
        field: Floats = self.field.copy()
        field[axis] += by
        return field

    def measured(self, name: str, default: float, expected: Floats) -> float:
        """The value of a shift or a scale that gives what is expected; the default where that is it, or tells more."""
        value = self.flight.setting(name) or 0.0
        if "_OFS" in name:
            value -= float(median(self.field["XYZ".index(name[-1])] - expected["XYZ".index(name[-1])]))
            return default if abs(value - default) < _NEAR * _size(expected) else float(round(value))
        if "_SCALE" in name:
            value *= _size(expected) / _size(self.field)
            return default if math.isclose(value, default, rel_tol=_NEAR) else float(f"{value:.3g}")
        return default


def _by_others(compasses: list[_Compass]) -> Undone | None:
    """A compass that another agrees with once one of its parameters is undone. One that is told to be outside the board
    agrees as well with those inside it once it is turned with them: unless gravity says that the board is mounted as it
    is told, that is what is wrong, since drivers find out themselves where a compass is."""
    found = list(_mended_by_others(compasses))
    is_right = bool(compasses) and _is_told_by_gravity(compasses[0].flight)
    return min(found, key=lambda one: "_EXTERN" in one.parameter and not is_right, default=None)


def _is_told_by_gravity(flight: Flight) -> bool:
    """Whether the board's mounting is one that gravity tells, and right by it."""
    turned = matrix(flight.setting("AHRS_ORIENTATION") or 0.0)
    return turned is not None and abs(turned[2, 2] - 1.0) > _TILTED and gravity.is_upright(flight)


def _mended_by_others(compasses: list[_Compass]) -> Iterator[Undone]:
    is_refused = bool(compasses) and compasses[0].flight.refused_for("compass", "mag field") is not None
    limit = _REFUSED if is_refused else _APART
    for one, other in permutations(compasses, 2):
        expected = np.stack([aligned(one.table.t, other.table.t, row) for row in other.field])
        size = _size(expected)
        apart = _apart(one.field, expected) / size
        if not apart > limit or not one.is_used:
            continue
        undone = [(_apart(field, expected) / size, name, default) for name, default, field in one.undone()]
        left, name, default = min(undone, default=(math.inf, "", 0.0))
        if left < min(_AGREES, _MENDS * apart):
            yield Undone(
                parameter=name,
                wanted=one.measured(name, default, expected),
                title=_title(one, name),
                evidence=(
                    f"compasses {one.number} and {other.number} differ by {100 * apart:.0f}% of the field (limit "
                    f"{100 * limit:.0f}%) with {name}={one.flight.setting(name):g}, and would by {100 * left:.0f}% "
                    f"with its default {default:g}"
                ),
            )


def _by_course(flight: Flight, compasses: list[_Compass]) -> Undone | None:
    """A compass whose heading is not the one in which the copter speeds up where it leans."""
    leans, attitude = Leans.of(flight), flight.one("ATT", "Roll", "Pitch", "Yaw")
    if leans is None or attitude is None:
        return None
    declination = flight.setting("COMPASS_DEC") or 0.0
    for one in compasses:

        def course(field: Floats, t: Floats = one.table.t) -> Course:
            return leans.against(t, _heading(attitude, t, field) + declination)

        driven = course(one.field)
        found = _by_declination(flight, declination, driven) or _turned(one, driven, course)
        if found is not None:
            return found
    return None


def _turned(one: _Compass, driven: Course, course: Callable[[Floats], Course]) -> Undone | None:
    """A compass outside the board that is turned, with the mounting that it asks for: its default, or another."""
    name = one.mounting
    number = one.flight.setting(name) or 0.0
    if not name.startswith("COMPASS_") or (driven.explained > _EXPLAINED and abs(driven.off_deg) < _TURNED_DEG):
        return None
    default = one.flight.default_left(name)
    if default is None and sum(end - start for start, end in one.flight.flown) < _UNTOUCHED_S:
        return None
    mountings = [*([] if default is None else [default]), *(float(n) for n in range(_FLAT) if n != number)]
    for mounting in mountings:
        field = one.mounted(mounting)
        if field is None:
            continue
        told = course(field)
        is_right = told.explained > _EXPLAINED and abs(told.off_deg) < _RIGHT_DEG
        needed = driven.explained + (0.0 if abs(driven.off_deg) > _TURNED_DEG else _BETTER)
        if is_right and told.explained > needed - _ROUNDED:
            return Undone(
                parameter=name,
                wanted=mounting,
                title=_title(one, name),
                evidence=(
                    f"with {name}={number:g} the heading of compass {one.number} explains "
                    f"{100 * max(driven.explained, 0):.0f}% of how the vehicle sped up where it leaned, with "
                    f"{mounting:g} it would {100 * told.explained:.0f}%"
                ),
            )
    return None


def _by_declination(flight: Flight, declination: float, driven: Course) -> Undone | None:
    """A declination that somebody gave, where the heading is off by a constant angle."""
    is_off = abs(driven.off_deg) > _OFF_DEG and driven.explained > _EXPLAINED
    if not is_off or flight.default_left("COMPASS_AUTODEC") is None or flight.setting("COMPASS_AUTODEC"):
        return None
    wanted = math.remainder(declination + math.radians(driven.off_deg), 2 * math.pi)
    return Undone(
        parameter="COMPASS_DEC",
        wanted=float(f"{wanted:.2f}"),
        title="the magnetic declination is set wrongly",
        evidence=(
            f"the compass heading is {abs(driven.off_deg):.0f} degrees off the course that the vehicle flew (limit "
            f"{_OFF_DEG:g}) with COMPASS_DEC={declination:.3g} and COMPASS_AUTODEC=0"
        ),
    )


def _title(one: _Compass, name: str) -> str:
    if name == "AHRS_ORIENTATION":
        return "the board is mounted otherwise than it is told"
    return f"compass {one.number} is set up wrongly"


def _heading(attitude: Table, t: Floats, field: Floats) -> Floats:
    """The magnetic heading (radians) by a field in the vehicle's frame, shape (3, n), and the attitude."""
    roll, pitch = (np.radians(aligned(t, attitude.t, attitude[angle])) for angle in ("Roll", "Pitch"))
    x, y, z = field
    down = y * np.sin(roll) + z * np.cos(roll)
    north: Floats = np.arctan2(z * np.sin(roll) - y * np.cos(roll), x * np.cos(pitch) + down * np.sin(pitch))
    return north


def _size(field: Floats) -> float:
    return max(float(median(length(field))), 1.0)


def _apart(field: Floats, expected: Floats) -> float:
    return float(median(length(field - expected)))


CHECK = Check("heading settings", "a compass or a board that a parameter turns, shifts or scales", READS, LIMITS, find)

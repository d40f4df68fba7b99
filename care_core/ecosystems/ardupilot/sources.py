"""The sources of an ArduPilot vehicle that vary while it moves, and what tells that it does.

In 250 logs of healthy flights and drives, simulated ones among them, inertial sensors and estimates never repeat
themselves; receivers do for 26 s in a still hover, compasses for 41 s at one heading, barometers for 33 s at one
height.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from care_core.ecosystems.ardupilot.armed import Armed
from care_core.ecosystems.ardupilot.instances import FIX, instances, sees_nothing
from care_core.ecosystems.ardupilot.messages import expanded
from care_core.ecosystems.base import Limits
from care_core.ecosystems.findings import FindingKind
from care_core.ecosystems.liveness import (
    ASIDE,
    WATCHED,
    ZERO,
    Frozen,
    Live,
    Motion,
    Unconnected,
    is_part,
    longest_repetitions,
    motion_shown,
    no_pack,
    numberless,
    overlaps,
    ranged,
    repeats,
    says_nothing,
    turned,
)
from care_core.ecosystems.spans import Span, during
from care_core.ecosystems.vehicles import flies
from care_core.geodesy import offset_m
from care_core.logs.base import Table, Wanted, merge_needs
from care_core.numbers import Floats

LIMITS = Limits()
_s = longest_repetitions(LIMITS, "any of 250 healthy logs repeats while it moves so far")
_SHOWS = motion_shown(LIMITS)
_ANY = _SHOWS.any

SOURCES = (
    Live("GPS", ("Lat", "Lng"), "the GPS", "gps", _s("GPS", 5.0), _SHOWS.place),
    Live("IMU", ("GyrX", "GyrY", "GyrZ"), "the gyro", "imu", _s("gyro", 1.0), _ANY),
    Live("IMU", ("AccX", "AccY", "AccZ"), "the accelerometer", "imu", _s("accelerometer", 1.0), _ANY),
    Live("MAG", ("MagX", "MagY", "MagZ"), "the compass", "compass", _s("compass", 3.0), _SHOWS.heading),
    Live("BARO", ("Alt",), "the barometer", "barometer", _s("barometer", 5.0), _SHOWS.height),
    Live("ATT", ("Roll", "Pitch", "Yaw"), "the attitude", "estimator", _s("attitude", 3.0), _ANY),
    Live("POS", ("Lat", "Lng"), "the estimated position", "estimator", _s("position", 5.0), _SHOWS.place),
    Live("POS", ("RelHomeAlt",), "the estimated height", "estimator", _s("height", 5.0), _SHOWS.height),
    Live("BAT", ("Volt", "Curr"), "the battery's monitor", "battery", _s("battery", 30.0), _ANY, is_optional=True,
         mission_lost=WATCHED),
    Live("BAT", ("Curr",), "the current sensor", "battery", _s("current sensor", 30.0), _ANY, is_optional=True,
         mission_lost=WATCHED),
    Live("ARSP", ("Airspeed",), "the airspeed sensor", "airspeed", _s("airspeed", 5.0), _SHOWS.place, is_optional=True,
         mission_lost=ASIDE),
    Live("RCOU", tuple(f"C{n}" for n in range(1, 15)), "the record of the motor outputs", "motor", _s("outputs", 10.0),
         _ANY, is_optional=True, mission_lost=WATCHED),
)  # fmt: skip
_SAME_THROTTLE = 0.03
_ZEROS: Mapping[str, tuple[FindingKind, str, tuple[str, ...]]] = {
    "MAG": ("compass", "compass", ("MagX", "MagY", "MagZ")),
    "ARSP": ("airspeed", "airspeed sensor", ("Airspeed",)),
    "RFND": ("barometer", "range finder", ("Dist",)),
}
"""Sensors that read zero where they are not fitted."""
READS: Wanted = merge_needs((
    *({message: fields} for message, (_, _, fields) in _ZEROS.items()),
    *({source.message: source.fields} for source in SOURCES),
    {"GPS": ("Alt", "Status", "NSats"), "CTUN": ("Alt", "BAlt")},
))  # fmt: skip
ATTITUDE = tuple(source for source in SOURCES if source.message == "ATT")


def _moved(source: Live, flight: Armed) -> Motion:
    """What others must tell: a drive straight ahead turns nothing, and its attitude is logged to 0.01 degrees."""
    return source.moved if source not in ATTITUDE or flies(flight.mode_kind) else _SHOWS.heading


def frozen(flight: Armed, moving: Sequence[Span], sources: Sequence[Live] = SOURCES) -> Iterator[Frozen]:
    """Every stretch in which a source says the same while others tell that the vehicle moved, in spans in which it
    does: what stands on the ground moves by its estimate alone."""
    flight.tables(expanded(READS if sources is SOURCES else {source.message: source.fields for source in sources}))
    told: list[Frozen] = []
    for source in sources:
        if source.message == "RCOU" and not flight.is_copter:
            continue  # servos and throttles stay where they are
        for number, table in enumerate(flight.all(source.message, source.fields[0]), start=1):
            for one in _frozen_in(flight, source, _named(source.message, number), table, moving):
                if one.motion is None:
                    yield one
                elif not is_part(one, told):
                    told.append(one)
                    yield one


def _frozen_in(flight: Armed, source: Live, name: str, table: Table, moving: Sequence[Span]) -> Iterator[Frozen]:
    """The stretches of one instance of a source."""
    fields = [field for field in source.fields if field in table.columns]
    if source.message in _ZEROS and all(says_nothing(table[field]) for field in fields):
        return  # it is not connected
    own = _fixed(table) if source.message == "GPS" else table
    columns = [own[field] for field in fields]
    if not source.is_optional:
        yield from (Frozen(source, name, *one, None) for one in numberless(own.t, columns, source))
    for span, count in repeats(own.t, columns, source):
        if source.message == "BAT" and _holds_its_throttle(flight, span):
            continue  # one throttle takes one current, and moves no sensor that counts in steps
        parts = (motion_of(flight, part, source.message) for part in overlaps(span, moving, source.seconds))
        motion = next((one for one in parts if one.reaches(_moved(source, flight))), None)
        if motion is not None:
            yield Frozen(source, name, span, count, motion)


def _holds_its_throttle(flight: Armed, span: Span) -> bool:
    """Whether a vehicle on wheels or wings kept its throttle all the while."""
    if flight.is_copter or flight.throttle is None:
        return False
    t, throttle = flight.throttle
    held = throttle[(t >= span[0]) & (t <= span[1])]
    return len(held) > 1 and float(np.ptp(held)) < _SAME_THROTTLE


def unconnected(flight: Armed, hovering: Sequence[Span]) -> Iterator[Unconnected]:
    """Sources of a vehicle that was armed, or was to be, which say nothing from first to last.

    Args:
        hovering: when motors held it in the air.
    """
    if not flight.armed and not flight.lasting_refusals:
        return
    yield from _no_packs(flight, hovering)
    receivers = recorded_instances(flight, "GPS", "Status", "NSats")
    for number, table in enumerate(receivers, start=1):
        if sees_nothing(table):
            name = "the GPS" if len(receivers) == 1 else f"GPS {number}"
            why = f"no satellite and no fix in {len(table)} records"
            yield Unconnected("gps", f"{name} sees no satellites", why, _named("GPS", number))
    for message, (kind, noun, fields) in _ZEROS.items():
        tables = recorded_instances(flight, message, *fields)
        for number, table in enumerate(tables, start=1):
            if all(says_nothing(table[field]) for field in fields if field in table.columns):
                name = f"the {noun}" if len(tables) == 1 else f"{noun} {number}"
                yield Unconnected(kind, f"{name} reads zero all along", ZERO, _named(message, number))


def _no_packs(flight: Armed, hovering: Sequence[Span]) -> Iterator[Unconnected]:
    """Monitors of batteries without a battery. Where none is set up, the firmware may record nothing of it."""
    monitors = recorded_instances(flight, "BAT", "Volt")
    for number, table in enumerate(monitors, start=1):
        if why := no_pack_on(table, hovering):
            name = "no battery monitor" if number == 1 else f"no monitor of battery {number}"
            yield Unconnected(
                "battery", f"{name} is connected: {np.nanmax(table['Volt']):.1f} V", why, _named("BAT", number)
            )
    if not monitors and flight.setting("BATT_MONITOR") == 0:
        why = "BATT_MONITOR is 0, and no voltage is recorded"
        yield Unconnected("battery", "no battery monitor is set up", why, "BAT")


def no_pack_on(battery: Table, hovering: Sequence[Span]) -> str:
    """Why no pack is connected to the monitor of a battery, in words; "" where one may be."""
    return no_pack(battery["Volt"], battery["Volt"][during(hovering, battery.t)])


def recorded_instances(flight: Armed, name: str, *fields: str) -> tuple[Table, ...]:
    """The instances of a message with its first field as they were recorded, those that measure nothing among them."""
    tables = flight.tables(expanded({name: fields}))
    return tuple(table for table in instances(tables, name) if fields[0] in table.columns)


def _named(message: str, number: int) -> str:
    return message if number == 1 else f"{message} {number}"


def _fixed(table: Table) -> Table:
    """Where a receiver has a position: without a fix it repeats the last one, or says 0."""
    fixed = np.abs(table["Lat"]) + np.abs(table["Lng"]) > 1e-6
    return table.where(fixed & (table["Status"] >= FIX) if "Status" in table.columns else fixed)


def motion_of(flight: Armed, span: Span, but: str) -> Motion:
    """How far the vehicle came in a span, by any source but that of one message."""

    def told(name: str, *fields: str) -> Table | None:
        table = None if name == but else flight.one(name, *fields)
        return None if table is None else table.between(*span)

    places = [_fixed(one) for name in ("POS", "GPS") if (one := told(name, "Lat", "Lng")) is not None]
    angles = told("ATT", "Roll", "Pitch", "Yaw")
    heights = (
        []
        if not flies(flight.mode_kind)
        else [
            one[field]
            for name, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt"), ("BARO", "Alt"), ("GPS", "Alt"))
            if (one := told(name, field)) is not None
        ]
    )
    return Motion(
        max(map(_way_m, places), default=0.0),
        max((turned(angles[name]) for name in ("Roll", "Pitch", "Yaw")), default=0.0) if angles is not None else
        _turned_by_gyro(told("IMU", "GyrX", "GyrY", "GyrZ")),
        max(map(ranged, heights), default=0.0),
    )  # fmt: skip


def _way_m(place: Table) -> float:
    known = place.where((np.abs(place["Lat"]) > 1e-6) & np.isfinite(place["Lat"] + place["Lng"]))
    if not len(known):
        return 0.0
    first = float(known["Lat"][0]), float(known["Lng"][0])
    return ranged(*offset_m(first, known["Lat"], known["Lng"]))


def _turned_by_gyro(imu: Table | None) -> float:
    """Degrees about the axis that it turned most about."""
    if imu is None or len(imu) < 2:
        return 0.0
    step_s: Floats = np.diff(imu.t)
    return max(ranged(np.degrees(np.cumsum(imu[name][1:] * step_s))) for name in ("GyrX", "GyrY", "GyrZ"))

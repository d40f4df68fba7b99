"""The sources of a PX4 vehicle that vary while it moves, and what tells that it does."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from care_core.ecosystems.base import Limits, RunModel
from care_core.ecosystems.findings import FindingKind
from care_core.ecosystems.liveness import (
    ASIDE,
    WATCHED,
    ZERO,
    Frozen,
    Live,
    Motion,
    Unconnected,
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
from care_core.ecosystems.spans import Span, inside
from care_core.ecosystems.vehicles import is_simulated
from care_core.geodesy import offset_m
from care_core.logs.base import Table, Wanted, merge_needs
from care_core.numbers import Floats

LIMITS = Limits()
_s = longest_repetitions(LIMITS, "healthy ArduPilot vehicles repeat while they move so far")
_SHOWS = motion_shown(LIMITS)
_ANY = _SHOWS.any


def _axes(name: str, count: int = 3) -> tuple[str, ...]:
    return tuple(f"{name}[{number}]" for number in range(count))


_PLACES = {
    "sensor_gps": (("latitude_deg", "longitude_deg"), ("lat", "lon")),
    "vehicle_gps_position": (("latitude_deg", "longitude_deg"), ("lat", "lon")),
}
_GPS = ("latitude_deg", "longitude_deg", "lat", "lon")
SOURCES = (
    *(Live(topic, _GPS, "the GPS", "gps", _s(f"GPS ({topic})", 5.0), _SHOWS.place) for topic in _PLACES),
    Live("sensor_combined", _axes("gyro_rad"), "the gyro", "imu", _s("gyro", 1.0), _ANY),
    Live("sensor_combined", _axes("accelerometer_m_s2"), "the accelerometer", "imu", _s("accelerometer", 1.0), _ANY),
    Live("vehicle_magnetometer", _axes("magnetometer_ga"), "the compass", "compass", _s("compass", 3.0),
         _SHOWS.heading),
    Live("vehicle_air_data", ("baro_alt_meter",), "the barometer", "barometer", _s("barometer", 5.0),
         _SHOWS.height),
    Live("vehicle_attitude", _axes("q", 4), "the attitude", "estimator", _s("attitude", 3.0), _ANY),
    Live("vehicle_local_position", ("x", "y"), "the estimated position", "estimator", _s("position", 5.0),
         _SHOWS.place),
    Live("vehicle_local_position", ("z",), "the estimated height", "estimator", _s("height", 5.0),
         _SHOWS.height),
    Live("battery_status", ("voltage_v", "current_a"), "the battery's monitor", "battery", _s("battery", 30.0), _ANY,
         is_optional=True, mission_lost=WATCHED),
    Live("airspeed", ("indicated_airspeed_m_s",), "the airspeed sensor", "barometer", _s("airspeed", 5.0), _ANY,
         is_optional=True, mission_lost=ASIDE),
    Live("actuator_outputs", _axes("output", 8), "the record of the motor outputs", "motor", _s("outputs", 10.0), _ANY,
         is_optional=True, mission_lost=WATCHED),
)  # fmt: skip
SENSORS = tuple(one for one in SOURCES if one.message in ("vehicle_air_data", "vehicle_magnetometer", *_PLACES))
"""Those whose topic ends where no sensor of theirs is left."""
_VALID = {("vehicle_local_position", "x"): "xy_valid", ("vehicle_local_position", "z"): "z_valid"}
"""What an estimator says of its own numbers, by the topic and the first of them: it fills with zeros what it does not
know (VehicleLocalPosition.msg)."""
_DEGREES = 1e7
"""Before 1.14 latitudes are integers of 1e-7 degrees."""
_BATTERY = "battery_status"
_NO_FIX = 1.0
"""fix_type of a receiver without a fix (SensorGps.msg)."""
_ZEROS: Mapping[str, tuple[FindingKind, str, tuple[str, ...]]] = {
    "vehicle_magnetometer": ("compass", "compass", _axes("magnetometer_ga")),
    "airspeed": ("barometer", "airspeed sensor", ("indicated_airspeed_m_s",)),
    "distance_sensor": ("barometer", "range finder", ("current_distance",)),
}
"""Sensors that read zero where they are not fitted."""
READS: Wanted = merge_needs((
    *({source.message: source.fields} for source in SOURCES),
    *({topic: fields} for topic, (_, _, fields) in _ZEROS.items()),
    *({topic: ("fix_type", "satellites_used")} for topic in _PLACES),
    *({topic: (valid,)} for (topic, _), valid in _VALID.items()),
    {_BATTERY: ("connected",)},
))  # fmt: skip


def frozen(model: RunModel, moving: Sequence[Span]) -> Iterator[Frozen]:
    """Every stretch in which a source says the same while others tell that the vehicle moved, in spans aloft."""
    tables = model.tables(READS)
    if is_simulated(model.log.facts, {}):  # its battery is discharged to SIM_BAT_MIN_PCT and no further
        tables = {name: table for name, table in tables.items() if name != _BATTERY}
    for source in (one for one in SOURCES if one.message in tables):
        table = _known(tables[source.message], source)
        fields = [field for field in source.fields if field in table.columns]
        columns = [table[field] for field in fields]
        if not fields or (source.message in _ZEROS and all(map(says_nothing, columns))) or _sees_nothing(table):
            continue
        for span, count in () if source.is_optional else numberless(table.t, columns, source):
            if any(True for _ in overlaps(span, moving, source.seconds)):
                yield Frozen(source, source.message, span, count, None)
        for span, count in repeats(table.t, columns, source):
            for part in overlaps(span, moving, source.seconds):
                motion = _motion(model, part, source.message)
                if motion.reaches(source.moved):
                    yield Frozen(source, source.message, span, count, motion)
                    break


def _known(table: Table, source: Live) -> Table:
    """What a source says without what it says itself not to know."""
    valid = _VALID.get((source.message, source.fields[0]), "")
    return table.where(table[valid] != 0) if valid in table.columns else table


def unconnected(model: RunModel, hovering: Sequence[Span]) -> Iterator[Unconnected]:
    """Sources that say nothing from first to last.

    Args:
        hovering: when a multicopter flew; empty of what flies otherwise.
    """
    tables = {name: table for name, table in model.tables(READS).items() if len(table)}
    if _holds(tables, _BATTERY, "voltage_v"):
        yield from _no_pack(tables[_BATTERY], hovering)
    receivers = [name for name in _PLACES if name in tables]
    if receivers and all(_sees_nothing(tables[name]) for name in receivers):
        why = f"no satellite and no fix in {len(tables[receivers[0]])} records"
        yield Unconnected("gps", "the GPS sees no satellites", why, receivers[0])
    for topic, (kind, noun, fields) in _ZEROS.items():
        columns = (
            [tables[topic][field] for field in fields if field in tables[topic].columns] if topic in tables else []
        )
        if columns and all(map(says_nothing, columns)):
            yield Unconnected(kind, f"the {noun} reads zero all along", ZERO, topic)


def _no_pack(battery: Table, hovering: Sequence[Span]) -> Iterator[Unconnected]:
    volts = battery["voltage_v"]
    why = no_pack(volts, volts[inside(hovering, battery.t)])
    if not why and "connected" in battery.columns and not battery["connected"].any():
        why = "the firmware finds none connected from first to last"
    if why:
        title = f"no battery monitor is connected: {np.nanmax(volts):.1f} V"
        yield Unconnected("battery", title, why, _BATTERY)


def _sees_nothing(receiver: Table) -> bool:
    if not {"fix_type", "satellites_used"} <= receiver.columns.keys():
        return False
    return says_nothing(receiver["satellites_used"]) and says_nothing(receiver["fix_type"], _NO_FIX)


def _motion(model: RunModel, span: Span, but: str) -> Motion:
    """How far the vehicle came in a span, by any source but one."""
    tables = {name: table.between(*span) for name, table in model.tables(READS).items() if name != but}
    ways, turns, rises = [0.0], [0.0], [0.0]
    for name, pairs in _PLACES.items():
        ways += [_way_m(tables[name], *pair) for pair in pairs if _holds(tables, name, *pair)]
    if _holds(tables, "vehicle_local_position", "x", "y", "z"):
        place = tables["vehicle_local_position"]
        ways.append(ranged(place["x"], place["y"]))
        rises.append(ranged(place["z"]))
    if _holds(tables, "vehicle_air_data", "baro_alt_meter"):
        rises.append(ranged(tables["vehicle_air_data"]["baro_alt_meter"]))
    if _holds(tables, "vehicle_attitude", *_axes("q", 4)):
        turns.append(turned(_yaw_deg(tables["vehicle_attitude"])))
    elif _holds(tables, "sensor_combined", *_axes("gyro_rad")):
        gyros, step_s = tables["sensor_combined"], np.diff(tables["sensor_combined"].t)
        turns += [ranged(np.degrees(np.cumsum(gyros[name][1:] * step_s))) for name in _axes("gyro_rad")]
    return Motion(max(ways), max(turns), max(rises))


def _holds(tables: dict[str, Table], name: str, *fields: str) -> bool:
    return name in tables and len(tables[name]) > 1 and all(field in tables[name].columns for field in fields)


def _way_m(place: Table, lat_name: str, lon_name: str) -> float:
    scale = 1.0 if lat_name.endswith("_deg") else 1 / _DEGREES
    lat, lon = place[lat_name] * scale, place[lon_name] * scale
    return ranged(*offset_m((float(lat[0]), float(lon[0])), lat, lon))


def _yaw_deg(attitude: Table) -> Floats:
    w, x, y, z = (attitude[name] for name in _axes("q", 4))
    return np.asarray(np.degrees(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))))

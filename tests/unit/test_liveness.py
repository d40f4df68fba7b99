"""A sensor that only repeats itself while its vehicle moves is named, and nothing is measured by it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from care_core.ecosystems.examine import examine
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.liveness import Frozen, is_part
from care_core.ecosystems.measures import find_extractor
from care_core.ecosystems.registry import run_model
from care_core.ecosystems.ros.messages import LOCALISED
from care_core.ecosystems.ros.sources import SOURCES
from care_core.ecosystems.ros.sources import frozen as frozen_of
from care_core.logs import formats
from care_core.logs.base import Table
from care_core.logs.opening import open_log
from care_core.records import Struct
from care_core.run import Unavailable
from tests.flights import Made
from tests.ros_drives import BATTERY, FAILS_AT_S, ODOMETRY, TWIST, Drive
from tests.tables import TablesLog
from tests.unit.test_coverage import flown

# ArduPilot


def made() -> Made:
    """A flight whose receiver and estimate wander as real ones do, so that nothing but what is frozen repeats."""
    flight = Made()
    flight.table["POS"]["Lng"] += flight.noise(1e-8)
    flight.table["BAT"]["Curr"] += flight.noise(0.1)
    flight.table["CTUN"]["Alt"] += flight.noise(0.01)
    flight.table["ARSP"] = {"Airspeed": 5 + flight.noise(0.2)}
    return flight


def freeze(flight: Made, name: str, start_s: float = 30.0, end_s: float = 1e9) -> None:
    """A message says from a time on what it said then."""
    held = flight.after(start_s, end_s)
    for column in flight.table[name].values():
        column[held] = column[np.argmax(held)]


def frozen(findings: tuple[Finding, ...]) -> list[Finding]:
    every = [*findings, *(later for one in findings for later in one.below)]
    return [one for one in every if one.title.endswith(("is frozen", "has no numbers"))]


@pytest.mark.parametrize(
    ("message", "title", "kind"),
    [
        ("GPS", "the GPS is frozen", "gps"),
        ("IMU", "the gyro is frozen", "imu"),
        ("MAG", "the compass is frozen", "compass"),
        ("ATT", "the attitude is frozen", "estimator"),
        ("POS", "the estimated position is frozen", "estimator"),
        ("BAT", "the battery's monitor is frozen", "battery"),
        ("ARSP", "the airspeed sensor is frozen", "airspeed"),
        ("RCOU", "the record of the motor outputs is frozen", "motor"),
    ],
)
def test_a_source_that_freezes_in_flight_is_named_with_its_onset(message: str, title: str, kind: str) -> None:
    flight = made()
    freeze(flight, message)
    found = next(one for one in frozen(flight.find()) if one.title == title)
    assert found.kind == kind
    assert found.onset_s == pytest.approx(30.0, abs=0.2)


@pytest.mark.parametrize("stuck_at", [0.0, 20.0])
def test_a_current_sensor_that_dies_beside_a_living_voltage_is_named(stuck_at: float) -> None:
    flight = made()
    flight.table["BAT"]["Curr"][flight.after(30.0)] = stuck_at
    assert [one.title for one in frozen(flight.find())] == ["the current sensor is frozen"]


def test_an_attitude_that_freezes_has_lost_no_control() -> None:
    flight = made()
    freeze(flight, "ATT")
    flight.table["ATT"]["DesPitch"][flight.after(50.0)] = 45.0
    findings = flight.find()
    assert [one.title for one in frozen(findings)] == ["the attitude is frozen"]
    assert flight.flight().lost_control_s is None
    assert not [one for one in findings if one.kind == "attitude"]


def test_a_straight_drive_over_flat_ground_turns_no_attitude() -> None:
    """A rover on one heading: its attitude is logged to 0.01 degrees."""
    drive = made()
    drive.facts = {"firmware": "ArduRover V4.5.4 (fd1bcc61)", "vehicle": "rover"}
    drive.rows["MODE"] = [(0.0, {"ModeNum": 10.0})]
    for field, angle in (("Roll", 0.07), ("Pitch", 0.03), ("Yaw", 99.09)):
        drive.table["ATT"][field][drive.after(30.0, 42.0)] = angle
    assert "the attitude is frozen" not in [one.title for one in frozen(drive.find())]


def test_a_height_that_reads_zero_in_flight_is_frozen_although_by_it_nothing_flies() -> None:
    flight = made()
    flight.table["POS"]["RelHomeAlt"][flight.after(30.0)] = 0.0
    found = frozen(flight.find())
    assert [(one.title, round(one.onset_s)) for one in found] == [("the estimated height is frozen", 30)]


def test_a_barometer_that_freezes_on_the_way_down_is_named() -> None:
    flight = made()
    freeze(flight, "BARO", 85.0)
    assert [one.title for one in frozen(flight.find())] == ["the barometer is frozen"]


def test_a_frozen_receiver_leads_and_no_barometer_is_blamed_for_it() -> None:
    flight = made()
    climbing = np.interp(flight.t, [20, 60, 90, 99], [12, 60, 60, 0]) * (flight.t > 20)
    heights = (("POS", "RelHomeAlt"), ("CTUN", "Alt"), ("CTUN", "BAlt"), ("BARO", "Alt"), ("BARO#2", "Alt"))
    for name, field in (*heights, ("GPS", "Alt")):
        flight.table[name][field] += climbing
    freeze(flight, "GPS")
    findings = flight.find()
    assert findings[0].title == "the GPS is frozen"
    assert "barometer" not in [one.kind for one in findings]


def test_where_a_receiver_without_a_fix_puts_a_vehicle_it_never_was() -> None:
    flight = made()
    for name in ("GPS", "POS"):
        for field in ("Lat", "Lng"):
            flight.table[name][field][:] = flight.table[name][field][0]
    flight.table["GPS"]["Status"][flight.after(30.0)] = 1
    flight.table["GPS"]["Lat"][flight.after(35.0)] += 0.5
    for column in flight.table["ATT"].values():
        column[:] = 0.0
    for name, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt"), ("BARO", "Alt"), ("GPS", "Alt")):
        flight.table[name][field][:] = 0.0
    freeze(flight, "BAT")
    assert "the battery's monitor is frozen" not in [one.title for one in frozen(flight.find())]


def test_a_source_that_freezes_for_a_while_is_named_once() -> None:
    flight = made()
    freeze(flight, "IMU", 25.0, 31.0)
    freeze(flight, "IMU", 45.0, 52.0)
    titles = [one.title for one in frozen(flight.find())]
    assert sorted(titles) == ["the accelerometer is frozen", "the gyro is frozen"]


def test_a_sensor_without_numbers_is_named() -> None:
    flight = made()
    flight.table["MAG"]["MagX"][flight.after(50.0, 60.0)] = np.nan
    assert [one.title for one in frozen(flight.find())] == ["the compass has no numbers"]


@pytest.mark.parametrize("rate_hz", [1.0, 2.0, 10.0])
def test_a_healthy_flight_freezes_nothing(rate_hz: float) -> None:
    assert not frozen(Made(rate_hz).find())


def test_a_parked_vehicle_repeats_itself_rightly() -> None:
    flight = made()
    for name in ("GPS", "MAG", "BARO", "POS", "BAT"):
        freeze(flight, name, 0.0, 8.0)
    assert not frozen(flight.find())


def test_a_simulator_without_noise_that_hovers_freezes_nothing() -> None:
    flight = made()
    still = flight.after(63.0, 84.0)
    for name in ("GPS", "MAG", "BARO"):
        freeze(flight, name, 63.0, 84.0)
    flight.table["ATT"]["Yaw"][still] = 200.0
    flight.table["MAG"]["MagX"][still] = flight.table["MAG"]["MagX"][np.argmax(still)]
    assert not frozen(flight.find())


def test_a_rounded_voltage_repeats_itself_by_habit() -> None:
    flight = made()
    flight.table["BAT"]["Volt"] = np.round(flight.table["BAT"]["Volt"], 0)
    flight.table["BAT"]["Curr"] = np.round(flight.table["BAT"]["Curr"], -1)
    assert not frozen(flight.find())


def test_a_battery_that_is_not_measured_is_not_frozen() -> None:
    flight = made()
    flight.table["BAT"]["Volt"][:], flight.table["BAT"]["Curr"][:] = 12.0, 0.0
    assert not frozen(flight.find())


def test_a_measure_by_a_frozen_source_is_none() -> None:
    def change(tables: dict[str, Table]) -> None:
        battery = tables["BAT"]
        held = battery.t >= 40.0
        columns = {name: np.where(held, column[np.argmax(held)], column) for name, column in battery.columns.items()}
        columns["Curr"] = np.where(held, columns["Curr"], columns["Curr"] + 0.1 * np.sin(battery.t))
        tables["BAT"] = Table(battery.t, columns)

    value = find_extractor("energy_used").compute(flown(change), {})
    assert isinstance(value, Unavailable)
    assert value.reason.startswith("the battery (BAT) says the same from 40 s to ")


def test_a_path_by_a_frozen_receiver_is_none() -> None:
    def change(tables: dict[str, Table]) -> None:
        gps = tables["GPS"]
        held = gps.t >= 30.0
        tables["GPS"] = Table(gps.t, {name: np.where(held, c[np.argmax(held)], c) for name, c in gps.columns.items()})

    value = find_extractor("path_error").compute(flown(change), {})
    assert isinstance(value, Unavailable)
    assert value.reason.startswith("the receiver (GPS) says the same from 30 s to ")


# PX4


def px4(
    name: str = "", valid: float | None = None, ends: tuple[str, float] = ("", 100.0), **facts: str
) -> tuple[Finding, ...]:
    rng, t = np.random.default_rng(0), np.arange(0.0, 100.0, 0.1)

    def noise(size: float) -> Any:
        return rng.normal(0, size, len(t))

    north, up = np.interp(t, [20, 80], [0, 120]), np.interp(t, [10, 20, 80, 90], [0, 30, 30, 0])
    yaw = np.radians(np.interp(t, [20, 80], [0, 180]))
    tables: dict[str, dict[str, Any]] = {
        "vehicle_status": {"arming_state": np.where((t > 5) & (t < 95), 2.0, 1.0), "nav_state": np.full(len(t), 4.0)},
        "vehicle_local_position": {"x": north + noise(0.01), "y": noise(0.01), "z": -up + noise(0.01)},
        "vehicle_gps_position": {"lat": 4.7e8 + np.round(north / 0.0111 + noise(5)), "lon": 8e7 + np.round(noise(5))},
        "sensor_combined": {
            **{f"gyro_rad[{n}]": noise(0.01) for n in range(3)},
            **{f"accelerometer_m_s2[{n}]": noise(0.1) for n in range(3)},
        },
        "vehicle_air_data": {"baro_alt_meter": 400 + up + noise(0.1)},
        "vehicle_attitude": {"q[0]": np.cos(yaw / 2) + noise(1e-4), "q[1]": noise(1e-4), "q[2]": noise(1e-4),
                             "q[3]": np.sin(yaw / 2)},
        "vehicle_magnetometer": {f"magnetometer_ga[{n}]": 0.2 + noise(0.001) for n in range(3)},
        "battery_status": {"voltage_v": 12 + noise(0.01), "current_a": 20 + noise(0.2)},
    }  # fmt: skip
    if name:
        held = t >= 40.0
        tables[name] = {
            field: np.where(held, column[np.argmax(held)], column) for field, column in tables[name].items()
        }
    if valid is not None:
        tables["vehicle_local_position"]["xy_valid"] = np.full(len(t), valid)
    made = {one: Table(t, columns) for one, columns in tables.items()}
    if ends[0]:
        made[ends[0]] = made[ends[0]].between(0.0, ends[1])
    log = TablesLog(made, 100.0, formats.PX4_ULG, {"vehicle": "multicopter", **facts})
    return examine(run_model(log)).findings


@pytest.mark.parametrize(
    ("topic", "title"),
    [
        ("vehicle_gps_position", "the GPS is frozen"),
        ("sensor_combined", "the gyro is frozen"),
        ("vehicle_air_data", "the barometer is frozen"),
        ("vehicle_attitude", "the attitude is frozen"),
        ("vehicle_magnetometer", "the compass is frozen"),
        ("vehicle_local_position", "the estimated position is frozen"),
        ("battery_status", "the battery's monitor is frozen"),
    ],
)
def test_a_source_that_freezes_on_px4_is_named(topic: str, title: str) -> None:
    assert [one.onset_s for one in frozen(px4(topic)) if one.title == title] == [pytest.approx(40.0, abs=0.2)]


def test_a_simulators_battery_that_is_discharged_no_further_is_no_dead_monitor() -> None:
    assert not frozen(px4("battery_status", stack="PX4", hardware="PX4_SITL"))


@pytest.mark.parametrize(("valid", "titles"), [(1.0, ["the estimated position is frozen"]), (0.0, [])])
def test_a_position_that_the_estimator_says_it_does_not_know_is_not_frozen(valid: float, titles: list[str]) -> None:
    found = frozen(px4("vehicle_local_position", valid))
    assert [one.title for one in found if "position" in one.title] == titles


def test_a_healthy_px4_flight_freezes_nothing() -> None:
    assert not frozen(px4())


# ROS


class Held(Struct, eq=False):
    """A drive in which messages of a type repeat what they said when the fault began, or say no numbers."""

    drive: Drive
    kind: str
    says_nothing: bool = False

    def messages(self) -> Iterator[tuple[str, str, float, Any]]:
        last: Any = None
        for topic, kind, time_s, message in self.drive.messages():
            said = message
            if kind == self.kind and time_s >= FAILS_AT_S:
                said = last if not self.says_nothing else self._emptied(message)
            elif kind == self.kind:
                last = message
            yield topic, kind, time_s, said

    def _emptied(self, message: Any) -> Any:
        if self.kind == ODOMETRY:
            message.pose.pose.position.x = float("nan")
        else:
            message.linear.x = float("nan")
        return message


def driven(kind: str, folder: Path, *, says_nothing: bool = False) -> list[Finding]:
    drive = Drive()
    held = Held(drive, kind, says_nothing)

    class Written(Drive):
        def messages(self) -> Iterator[tuple[str, str, float, Any]]:
            return held.messages()

    return frozen(examine(run_model(open_log(Written().write(folder / "drive.mcap")))).findings)


@pytest.mark.parametrize(
    ("kind", "title"), [(ODOMETRY, "the odometry is frozen"), (TWIST, "the command to the base is frozen")]
)
def test_a_source_that_freezes_on_the_way_is_named(kind: str, title: str, tmp_path: Path) -> None:
    found = driven(kind, tmp_path)
    assert [one.title for one in found] == [title]
    assert found[0].onset_s == pytest.approx(FAILS_AT_S, abs=0.3)


@pytest.mark.parametrize(
    ("kind", "title"), [(ODOMETRY, "the odometry has no numbers"), (TWIST, "the command to the base has no numbers")]
)
def test_a_source_without_numbers_from_some_time_on_is_named(kind: str, title: str, tmp_path: Path) -> None:
    assert [one.title for one in driven(kind, tmp_path, says_nothing=True)] == [title]


def test_a_battery_that_repeats_itself_for_seconds_is_not_frozen(tmp_path: Path) -> None:
    assert not driven(BATTERY, tmp_path)


@pytest.mark.parametrize("whole", [False, True])
def test_a_battery_of_which_the_current_dies_is_named_once(whole: bool) -> None:
    t, rng = np.arange(0.0, 80.0, 0.5), np.random.default_rng(0)
    dead = t > 30.0
    current = np.where(dead, 0.0, rng.normal(-2.0, 0.1, len(t)))
    volts = np.where(dead & whole, 25.0, 25.0 - 0.001 * t + rng.normal(0.0, 0.01, len(t)))
    battery = Table(t, {"voltage": volts, "current": current})
    place = {"pose.pose.position.x": 0.5 * t, "pose.pose.position.y": 0 * t}
    odometry = Table(t, {**place, **{f"pose.pose.orientation.{axis}": 0 * t + (axis == "w") for axis in "xyzw"}})
    found: list[Frozen] = []
    for source in (one for one in SOURCES if "current" in one.fields):
        found += [one for one in frozen_of(source, "/battery", battery, {"/odom": odometry}) if not is_part(one, found)]
    assert [one.source.name for one in found] == ["the battery's monitor" if whole else "the battery's current"]


def test_a_healthy_drive_freezes_nothing(tmp_path: Path) -> None:
    assert not frozen(examine(run_model(open_log(Drive().write(tmp_path / "drive.mcap")))).findings)


@pytest.mark.parametrize(("sinks", "titles"), [(False, ["the localisation"]), (True, [])])
def test_a_pose_that_tells_a_depth_alone_is_not_frozen(sinks: bool, titles: list[str]) -> None:
    t = np.arange(0.0, 80.0, 0.5)
    turned = {f"pose.pose.orientation.{axis}": 0 * t + (axis == "w") for axis in "xyzw"}
    places = {"pose.pose.position.x": 0 * t, "pose.pose.position.y": 0 * t, "pose.pose.position.z": -0.01 * t * sinks}
    odometry = Table(t, {"pose.pose.position.x": 0.5 * t, "pose.pose.position.y": 0 * t, **turned})
    (source,) = (one for one in SOURCES if one.message == LOCALISED)
    found = frozen_of(source, "/depth", Table(t, {**places, **turned}), {"/odom": odometry})
    assert [one.source.name for one in found] == titles


@pytest.mark.parametrize(("last_s", "titles"), [(60.0, ["the barometer falls silent"]), (93.0, [])])
def test_a_sensor_that_falls_silent_on_px4_is_named(last_s: float, titles: list[str]) -> None:
    found = px4(ends=("vehicle_air_data", last_s))
    assert [one.title for one in found if one.title.endswith("falls silent")] == titles
    assert not [one for one in found if one.title.startswith("vehicle_air_data was recorded")]

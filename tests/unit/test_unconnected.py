"""Not connected is not broken: what says nothing from first to last is told as that, and never leads."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.ecosystems.ardupilot.examining import examine
from care_core.ecosystems.findings import Finding, Health, every_finding
from care_core.ecosystems.px4.examining import examine as examine_px4
from care_core.ecosystems.px4.flight import Px4Flight
from care_core.ecosystems.px4.missions import _checks
from care_core.logs.base import Table
from tests.flights import Made
from tests.unit.test_px4_health import MadeLog, states


def told(findings: tuple[Finding, ...], *kinds: str) -> list[tuple[str, str]]:
    return [(one.severity, one.title) for one in every_finding(findings) if one.kind in kinds]


def with_volts(volts: float, scatter: float = 0.0) -> Made:
    flight = Made()
    flight.table["BAT"]["Volt"] = volts + flight.noise(scatter)
    flight.table["BAT"]["Curr"] = np.zeros(len(flight.t))
    return flight


@pytest.mark.parametrize("scatter", [0.0, 0.01])
@pytest.mark.parametrize(("volts", "says"), [(0.1, "0.1 V"), (5.8, "5.8 V"), (5.0, "5.0 V"), (1.2, "1.2 V")])
def test_a_monitor_without_a_pack_is_told_as_that(volts: float, says: str, scatter: float) -> None:
    ((severity, title),) = told(with_volts(volts, scatter).find(), "battery")
    assert severity == "info"
    assert title.startswith("no battery monitor is connected: ")
    assert scatter or says in title


@pytest.mark.parametrize("volts", [3.9, 6.6, 7.6, 12.0])
def test_a_pack_of_any_size_is_connected(volts: float) -> None:
    assert not [one for one in told(with_volts(volts, 0.05).find(), "battery") if "connected" in one[1]]


def test_five_volts_may_drive_what_does_not_fly() -> None:
    rover = with_volts(5.8, 0.01)
    rover.facts = {"firmware": "ArduRover V4.5.4", "vehicle": "rover"}
    assert not [one for one in told(rover.find(), "battery") if "connected" in one[1]]


def test_a_battery_that_dies_in_flight_was_connected() -> None:
    flight = Made()
    flight.table["BAT"]["Volt"][flight.after(60.0)] = 0.1
    assert not [one for one in told(flight.find(), "battery") if "connected" in one[1]]


def test_no_monitor_is_set_up() -> None:
    flight = Made()
    del flight.table["BAT"]
    flight.settings["BATT_MONITOR"] = 0
    assert told(flight.find(), "battery") == [("info", "no battery monitor is set up")]


def blind(flight: Made, number: str = "") -> Made:
    for field in ("NSats", "Status", "Lat", "Lng", "Spd"):
        flight.table[f"GPS{number}"][field] = np.zeros(len(flight.t))
    return flight


def test_a_receiver_without_satellites_is_told_as_that() -> None:
    assert told(blind(Made()).find(), "gps") == [("info", "the GPS sees no satellites")]


@pytest.mark.parametrize("blind_one", ["", "#2"])
def test_one_of_two_receivers_without_satellites_hides_no_other(blind_one: str) -> None:
    flight = Made()
    flight.table["GPS"]["I"] = np.zeros(len(flight.t))
    flight.table["GPS#2"] = {field: column.copy() for field, column in flight.table["GPS"].items()}
    flight.table["GPS#2"]["I"] += 1
    number = 2 if blind_one else 1
    assert told(blind(flight, blind_one).find(), "gps") == [("info", f"GPS {number} sees no satellites")]
    receiver = flight.flight().one("GPS", "NSats")
    assert receiver is not None
    assert receiver["NSats"].min() == 14


def test_a_receiver_that_loses_its_satellites_is_still_a_fault() -> None:
    flight = Made()
    lost = flight.after(40.0, 80.0)
    flight.table["GPS"]["NSats"][lost] = flight.table["GPS"]["Status"][lost] = 0
    assert ("critical", "the GPS fix was lost in the air") in told(flight.find(), "gps")


def zero(flight: Made, *names: str) -> Made:
    for name in names:
        for axis in "XYZ":
            flight.table[name][f"Mag{axis}"] = np.zeros(len(flight.t))
    return flight


def test_compasses_that_read_zero_all_along_are_not_connected() -> None:
    both = told(zero(Made(), "MAG", "MAG#2").find(), "compass")
    assert both == [("info", "compass 1 reads zero all along"), ("info", "compass 2 reads zero all along")]
    assert told(zero(Made(), "MAG#2").find(), "compass") == [("info", "compass 2 reads zero all along")]


def test_a_compass_that_falls_silent_in_flight_is_still_a_fault() -> None:
    flight = Made()
    for axis in "XYZ":
        flight.table["MAG"][f"Mag{axis}"][flight.after(50.0)] = 0.0
    assert ("info", "compass 1 reads zero all along") not in told(flight.find(), "compass")
    assert any(title == "the compass reads nothing" for _, title in told(flight.find(), "compass"))


@pytest.mark.parametrize(
    ("message", "field", "title"),
    [
        ("ARSP", "Airspeed", "the airspeed sensor reads zero all along"),
        ("RFND", "Dist", "the range finder reads zero all along"),
    ],
)
def test_sensors_that_read_zero_all_along_are_not_connected(message: str, field: str, title: str) -> None:
    flight = Made()
    flight.table[message] = {field: np.zeros(len(flight.t))}
    assert told(flight.find(), "airspeed", "barometer") == [("info", title)]


def test_nothing_is_missing_of_a_healthy_flight() -> None:
    assert not told(Made().find(), "battery", "gps", "compass", "barometer")


def bench(*texts: str) -> Made:
    flight = Made()
    flight.rows["ARM"] = [(0.0, {"ArmState": 0.0, "Forced": 0.0})]
    flight.rows["MSG"] = [(2.0 + 25 * at, {"Message": text}) for at, text in enumerate(texts)] or [
        (1.0, {"Message": ""})
    ]
    for table in flight.table.values():
        for field in ("ThO", "ThI", "C1", "C2", "C3", "C4"):
            if field in table:
                table[field] = np.full(len(flight.t), 1000.0 if field[0] == "C" else 0.0)
    flight.table["IMU"]["GyrX"] += np.radians(9.0)
    return flight


def test_a_gyro_offset_of_a_board_on_a_bench_is_no_fault() -> None:
    health = examine(bench("PreArm: Gyros inconsistent", "PreArm: Gyros inconsistent").flight())
    assert {severity for severity, _ in told(health.findings, "imu")} <= {"info"}
    assert health.too_little
    assert not [one for one in health.findings if one.severity == "critical"]
    assert not told(bench().find(), "imu")


def test_a_gyro_offset_that_kept_it_from_arming_is_one() -> None:
    findings = bench("Arm: Gyros inconsistent", "Arm: Gyros inconsistent").find()
    assert any(severity != "info" for severity, _ in told(findings, "imu"))


# PX4


def px4(**topics: Table) -> tuple[Finding, ...]:
    return px4_health(**topics).findings


def px4_health(**topics: Table) -> Health:
    t = np.arange(0.0, 60.0, 0.1)
    usual = {
        "vehicle_status": states(arming_state=[(0, 1), (5, 2), (55, 1)], vehicle_type=[(0, 1)]),
        "vehicle_land_detected": states(landed=[(0, 1), (8, 0), (50, 1)]),
        "vehicle_local_position": Table(t, {"z": -np.interp(t, [8, 15, 45, 50], [0.0, 9, 9, 0])}),
        "battery_status": Table(t, {"voltage_v": 16 - t / 60, "connected": np.ones(600)}),
        "sensor_gps": Table(t, {"fix_type": np.full(600, 3.0), "satellites_used": np.full(600, 12.0)}),
    }
    made = {name: table for name, table in {**usual, **topics}.items() if len(table)}
    return examine_px4(Px4Flight(MadeLog(made)))


NONE = Table(np.empty(0), {})
T = np.arange(0.0, 60.0, 0.1)


@pytest.mark.parametrize(
    ("topic", "table", "title"),
    [
        ("battery_status", Table(T, {"voltage_v": np.full(600, 0.1)}), "no battery monitor is connected: 0.1 V"),
        ("battery_status", Table(T, {"voltage_v": np.full(600, 5.8)}), "no battery monitor is connected: 5.8 V"),
        ("battery_status", Table(T, {"voltage_v": np.full(600, 12.0), "connected": np.zeros(600)}),
         "no battery monitor is connected: 12.0 V"),
        ("sensor_gps", Table(T, {"fix_type": np.zeros(600), "satellites_used": np.zeros(600)}),
         "the GPS sees no satellites"),
        ("airspeed", Table(T, {"indicated_airspeed_m_s": np.zeros(600)}), "the airspeed sensor reads zero all along"),
        ("distance_sensor", Table(T, {"current_distance": np.zeros(600)}), "the range finder reads zero all along"),
    ],
)  # fmt: skip
def test_px4_tells_what_is_not_connected(topic: str, table: Table, title: str) -> None:
    assert [(one.severity, one.title) for one in px4(**{topic: table})] == [("info", title)]
    assert not px4()


def test_px4_finds_no_battery_unhealthy_that_is_not_there() -> None:
    flags = states(battery_unhealthy=[(0, 0), (20, 1)])
    none = Table(T, {"voltage_v": np.full(600, 0.1)})
    assert [one.severity for one in px4(battery_status=none, failsafe_flags=flags)] == ["info"]
    assert [one.title for one in px4(failsafe_flags=flags)] == ["battery unhealthy"]


@pytest.mark.parametrize(
    ("missing", "says"),
    [
        (("battery_status", "sensor_gps"), "battery and GPS were not recorded"),
        (("battery_status",), "battery was not recorded"),
        (("sensor_gps",), "GPS was not recorded"),
        ((), ""),
    ],
)
def test_what_px4_did_not_record_is_said(missing: tuple[str, ...], says: str) -> None:
    health = px4_health(**dict.fromkeys(missing, NONE))
    assert [event.text for event in health.timeline if "recorded" in event.text] == [says][: bool(says)]
    assert not health.findings


@pytest.mark.parametrize(("rise_m", "lasts_s", "took_off"), [(0.9, 40, True), (0.9, 2, False), (0.3, 40, False)])
def test_a_px4_flight_under_a_roof_took_off(rise_m: float, lasts_s: float, took_off: bool) -> None:
    made = {
        "vehicle_status": states(arming_state=[(0, 1), (5, 2), (55, 1)], vehicle_type=[(0, 1)]),
        "vehicle_land_detected": states(landed=[(0, 1), (8, 0), (8 + lasts_s, 1)]),
        "vehicle_local_position": Table(
            T, {"z": -np.interp(T, [8, 9, 8 + lasts_s, 9 + lasts_s], [0, rise_m, rise_m, 0])}
        ),
    }
    checks = {one.name: one.value for one in _checks(Px4Flight(MadeLog(made)), (5.0, 55.0), ended=True)}
    assert (checks["took_off"] == 1.0) is took_off
    assert checks["landed"] == 1.0


def test_what_grows_in_flight_is_of_no_pack() -> None:
    flight = with_volts(6.0)
    flight.table["BAT"]["Volt"] = np.interp(flight.t, [0.0, flight.t[-1]], [5.93, 6.1])
    ((severity, title),) = told(flight.find(), "battery")
    assert (severity, title) == ("info", "no battery monitor is connected: 6.1 V")
    flight.table["BAT"]["Volt"] = np.interp(
        flight.t, [0.0, flight.t[-1]], [6.1, 5.93]
    )  # two cells that are nearly empty
    assert not [one for one in told(flight.find(), "battery") if "connected" in one[1]]

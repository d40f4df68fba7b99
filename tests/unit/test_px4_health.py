"""The account of a PX4 flight, and what its own checks found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from care_core.ecosystems.dictionary import find_field
from care_core.ecosystems.findings import IDLED, STEERED, Health
from care_core.ecosystems.px4.attitude import lean_of
from care_core.ecosystems.px4.examining import examine, reads
from care_core.ecosystems.px4.flight import Px4Flight
from care_core.ecosystems.px4.messages import MESSAGES
from care_core.ecosystems.px4.preflight import read_by
from care_core.ecosystems.px4.upset import falls_after
from care_core.logs import formats
from care_core.logs.base import Channel, Table, Wanted
from care_core.logs.formats import LogFormat
from care_core.records import Struct, field
from care_core.run import Damage, Setting


class MadeLog(Struct, eq=False):
    """A ULog of tables."""

    tables: Mapping[str, Table]
    duration_s: float = 60.0
    parameters: Mapping[str, tuple[Setting, ...]] = field(default_factory=dict)
    damage: tuple[Damage, ...] = ()
    path: Path = Path("made.ulg")
    format: LogFormat = formats.PX4_ULG
    start: str | None = None
    facts: Mapping[str, str] = field(
        default_factory=lambda: {"stack": "PX4", "firmware": "PX4 v1.15.0 (cb09dde6)", "vehicle": "multicopter"}
    )

    def channels(self) -> tuple[Channel, ...]:
        return tuple(Channel(name, name, len(table)) for name, table in self.tables.items())

    def settings(self) -> Mapping[str, tuple[Setting, ...]]:
        return self.parameters

    def read(self, wanted: Wanted) -> Mapping[str, Table]:
        return {
            name: Table(table.t, {one: table[one] for one in wanted[name] if one in table.columns})
            for name, table in self.tables.items()
            if name in wanted
        }


def states(**changes: Sequence[tuple[float, float]]) -> Table:
    """A topic ten times a second whose fields change at given times."""
    t = np.arange(0.0, 60.0, 0.1)
    columns: dict[str, Any] = {}
    for name, steps in changes.items():
        at, values = zip(*steps, strict=True)
        columns[name] = np.array(values, dtype=np.float64)[np.searchsorted(at, t + 1e-9, side="right") - 1]
    return Table(t, columns)


def set_to(value: float) -> tuple[Setting, ...]:
    return (Setting("", value, "PARM", default=0.0),)


def words(*said: tuple[float, str, str]) -> Table:
    t, levels, texts = zip(*said, strict=True)
    return Table(np.array(t), {"level": np.array(levels, object), "message": np.array(texts, object)})


def texts(health: Health, kind: str = "") -> list[str]:
    return [moment.text for moment in health.timeline if not kind or moment.kind == kind]


FLOWN = states(arming_state=[(0, 1), (10, 2), (50, 1)], nav_state=[(0, 4), (10, 17), (20, 3), (40, 5)],
               failsafe=[(0, 0)])  # fmt: skip


def test_a_flight_is_told_by_its_status_and_its_words() -> None:
    health = examine(Px4Flight(MadeLog({
        "vehicle_status": FLOWN,
        "vehicle_land_detected": states(landed=[(0, 1), (12, 0), (48, 1)]),
        "logged_messages": words((0.0, "INFO", "[logger] Start file log"), (10.0, "INFO", "[commander] Armed by RC"),
                                 (40.0, "WARNING", "[failsafe] Failsafe activated\t")),
    })))  # fmt: skip
    assert texts(health) == [
        "PX4 v1.15.0, multicopter", "mode Hold", "armed by RC", "mode Takeoff", "battery and GPS were not recorded",
        "took off", "mode Mission", "Failsafe activated", "mode Return", "landed", "disarmed, armed for 40 s",
    ]  # fmt: skip
    assert health.findings == ()


def test_flags_raised_in_flight_are_findings_and_those_before_arming_are_not() -> None:
    health = examine(Px4Flight(MadeLog({
        "vehicle_status": FLOWN,
        "failsafe_flags": states(manual_control_signal_lost=[(0, 1), (5, 0), (30, 1), (33, 0)],
                                 gcs_connection_lost=[(0, 1)], fd_motor_failure=[(0, 0), (35, 1)]),
    })))  # fmt: skip
    assert [(one.kind, round(one.onset_s), one.severity) for one in health.findings] == [
        ("motor", 35, "critical"), ("radio", 30, "warning"),
    ]  # fmt: skip
    assert "radio lost for 3.0 s" in texts(health, "error")
    assert not any("ground station" in text for text in texts(health))


@pytest.mark.parametrize(("mode", "acts", "severity"), [(3, 1, "critical"), (2, 1, "info"), (3, 0, "info")])
def test_a_link_on_whose_loss_a_mission_was_broken_off_is_the_reason(mode: int, acts: int, severity: str) -> None:
    flown = states(arming_state=[(0, 1), (10, 2), (50, 1)], nav_state=[(0, mode), (30, 5)],
                   failsafe=[(0, 0), (30, acts)])  # fmt: skip
    lost = states(gcs_connection_lost=[(0, 0), (29.8, 1), (40, 0)])
    log = MadeLog({"vehicle_status": flown, "failsafe_flags": lost}, parameters={"NAV_DLL_ACT": set_to(3.0)})
    (finding,) = (one for one in examine(Px4Flight(log)).findings if one.kind == "radio")
    assert (finding.severity, "NAV_DLL_ACT is 3" in finding.evidence) == (severity, severity == "critical")


@pytest.mark.parametrize(
    ("flag", "name"),
    [
        ("flight_time_limit_exceeded", "COM_FLT_TIME_MAX"),
        ("wind_limit_exceeded", "COM_WIND_MAX"),
        ("geofence_breached", ""),
    ],
)
def test_a_limit_at_which_a_failsafe_acted_names_its_parameter(flag: str, name: str) -> None:
    flown = states(arming_state=[(0, 1), (10, 2), (50, 1)], nav_state=[(0, 3), (30, 5)], failsafe=[(0, 0), (30, 1)])
    up = states(**{flag: [(0, 0), (29.9, 1)]}, gcs_connection_lost=[(0, 1)])
    log = MadeLog({"vehicle_status": flown, "failsafe_flags": up}, parameters={name: set_to(20.0)})
    named = [one.parameters for one in examine(Px4Flight(log)).findings if one.parameters]
    assert named == ([(name,)] if name else [])


@pytest.mark.parametrize(("mean_a", "is_told"), [(250.0, True), (30.0, False)])
def test_a_battery_that_was_reckoned_with_a_current_that_it_never_drew(mean_a: float, is_told: bool) -> None:
    flown = states(arming_state=[(0, 1), (10, 2), (50, 1)], nav_state=[(0, 3), (30, 5)], failsafe=[(0, 0), (30, 1)])
    battery = states(voltage_v=[(0, 16.4)], current_a=[(0, 0.5), (12, 18.0)], remaining=[(0, 0.95)], warning=[(0, 0)])
    low = states(battery_low_remaining_time=[(0, 0), (30, 1)])
    topics = {"vehicle_status": flown, "battery_status": battery, "failsafe_flags": low}
    found = examine(Px4Flight(MadeLog(topics, parameters={"BAT_AVRG_CURRENT": set_to(mean_a)}))).findings
    assert [one.parameters for one in found if one.parameters] == ([("BAT_AVRG_CURRENT",)] if is_told else [])


def test_a_flight_that_never_had_a_radio_has_lost_none() -> None:
    flown = states(arming_state=[(0, 2), (40, 1)], nav_state=[(0, 17)])
    health = examine(
        Px4Flight(MadeLog({"vehicle_status": flown, "failsafe_flags": states(manual_control_signal_lost=[(0.3, 1)])}))
    )
    assert "radio" not in [one.kind for one in health.findings]


def test_a_sensor_that_the_estimator_rejects_is_found_after_a_second_of_it() -> None:
    ratios = states(vel_test_ratio=[(0, 0.1), (30, 1.4), (30.3, 0.2)], mag_test_ratio=[(0, 0.1), (30, 1.4), (36, 0.2)])
    health = examine(Px4Flight(MadeLog({"vehicle_status": FLOWN, "estimator_status": ratios})))
    assert [(one.kind, one.title) for one in health.findings] == [("compass", "estimator rejects compass")]


def test_a_vehicle_that_is_not_ready_says_why() -> None:
    text = "[commander_tests] Not ready to fly: Sensors not set up correctly"
    health = examine(Px4Flight(MadeLog({
        "vehicle_status": states(arming_state=[(0, 1)], nav_state=[(0, 0)]),
        "logged_messages": words((3.0, "WARNING", text)),
    })))  # fmt: skip
    assert texts(health, "arming") == ["it never armed: Sensors not set up correctly"]
    assert [(one.kind, one.title) for one in health.findings] == [
        ("prearm", "not ready to fly: Sensors not set up correctly"),
    ]  # fmt: skip


def test_what_the_commander_armed_was_armed_where_no_state_is_recorded() -> None:
    said = words(
        (2.0, "NOTICE", "Preflight Fail: Compasses inconsistent"),
        (3.0, "NOTICE", "Armed by external command"),
        (40.0, "NOTICE", "Disarmed by landing"),
    )
    health = examine(Px4Flight(MadeLog({"logged_messages": said})))
    assert not [one.title for one in health.findings]
    assert texts(health, "arming") == [
        "Preflight Fail: Compasses inconsistent", "armed by external command", "disarmed by landing, armed for 37 s",
    ]  # fmt: skip


def test_a_complaint_before_an_arming_is_no_finding() -> None:
    said = words((3.0, "WARNING", "[health_and_arming_checks] Preflight: GPS fix too low"))
    health = examine(Px4Flight(MadeLog({"vehicle_status": FLOWN, "logged_messages": said})))
    assert texts(health, "arming")[0] == "Preflight: GPS fix too low"
    assert health.findings == ()


def test_battery_and_satellites_in_brief() -> None:
    health = examine(Px4Flight(MadeLog({
        "vehicle_status": FLOWN,
        "battery_status": states(voltage_v=[(0, 16.4), (30, 13.1), (32, 15.0)], current_a=[(0, 2.0), (30, 50.0)],
                                 cell_count=[(0, 4)], warning=[(0, 0), (30, 1)], connected=[(0, 1)]),
        "vehicle_gps_position": states(fix_type=[(0, 3), (25, 0), (26, 3)], satellites_used=[(0, 12)]),
    })))  # fmt: skip
    assert texts(health, "battery") == [
        "battery at 16.4 V (4 cells)", "battery at its lowest while armed: 13.1 V at 50 A", "battery low",
    ]  # fmt: skip
    assert texts(health, "gps") == ["GPS: 3D fix, 12 satellites", "GPS lost its 3D fix while armed"]


def test_a_wrong_stamp_makes_no_long_flight() -> None:
    health = examine(Px4Flight(MadeLog({"vehicle_status": FLOWN}, duration_s=1200.0)))
    assert "the recording ends, but for a message stamped 1140 s later" in texts(health, "log")


def test_a_log_that_ends_armed_says_so() -> None:
    armed = states(arming_state=[(0, 1), (10, 2)], nav_state=[(0, 3)])
    assert texts(examine(Px4Flight(MadeLog({"vehicle_status": armed}))))[-1].startswith(
        "the log ends with the vehicle armed"
    )


def test_nothing_is_said_of_a_log_without_status() -> None:
    assert examine(Px4Flight(MadeLog({}))).too_little


def test_what_falls_after_the_kill_switch_is_the_kill_switchs_doing() -> None:
    def killed(up_m: float) -> Health:
        return examine(Px4Flight(MadeLog({
            "vehicle_status": FLOWN,
            "failsafe_flags": states(fd_critical_failure=[(0, 0), (42, 1), (43, 0)]),
            "vehicle_local_position": states(z=[(0, 0.0), (12, -up_m)]),
            "logged_messages": words((40.0, "WARNING", "[commander] Kill engaged\t")),
        })))  # fmt: skip

    (finding,) = killed(1.2).findings
    assert (finding.title, finding.suspect) == ("the kill switch cut the motors in the air", "operation")
    assert killed(0.1).findings == ()  # a pilot killed what did not let itself be disarmed


@pytest.mark.parametrize(("felt", "killed"), [(9.7, False), (1.0, True)])
def test_motors_that_are_killed_on_the_ground_fell_nowhere_whatever_the_height_says(felt: float, killed: bool) -> None:
    t = np.arange(0.0, 50.0, 0.02)
    force = np.where((t > 40.0) & (t < 40.5), felt, 9.7)
    flight = Px4Flight(MadeLog({
        "vehicle_status": FLOWN,
        "vehicle_local_position": states(z=[(0, 0.0), (12, -1.6)]),
        "vehicle_land_detected": states(landed=[(0, 1), (12, 0)]),
        "logged_messages": words((40.0, "WARNING", "[commander] Kill-switch engaged\t")),
        "sensor_combined": Table(t, {f"accelerometer_m_s2[{n}]": force * (n == 2) for n in range(3)}),
    }))  # fmt: skip
    assert ("the kill switch cut the motors in the air" in [one.title for one in examine(flight).findings]) is killed
    assert falls_after(flight, 40.0) is killed


@pytest.mark.parametrize(("swings_deg", "killed"), [(0.0, False), (50.0, True)])
def test_what_hangs_on_a_line_after_the_kill_switch_was_in_the_air(swings_deg: float, killed: bool) -> None:
    t = np.arange(0.0, 50.0, 0.02)
    half = np.radians(np.interp(t, [40.0, 41.5], [5.0, 5.0 + swings_deg])) / 2
    still = np.zeros_like(t)
    flight = Px4Flight(MadeLog({
        "vehicle_status": FLOWN,
        "vehicle_local_position": states(z=[(0, 0.0), (12, -1.6)]),
        "logged_messages": words((0.0, "INFO", "Arming check: Kill switch engaged"), (40.0, "WARNING", "Kill engaged")),
        "sensor_combined": Table(t, {f"accelerometer_m_s2[{n}]": still + 9.7 * (n == 2) for n in range(3)}),
        "vehicle_attitude": Table(t, {"q[0]": np.cos(half), "q[1]": np.sin(half), "q[2]": still, "q[3]": still}),
    }))  # fmt: skip
    assert ("the kill switch cut the motors in the air" in [one.title for one in examine(flight).findings]) is killed


def test_the_failure_detector_has_the_time_at_which_it_acted() -> None:
    def flown(**topics: Table) -> Px4Flight:
        return Px4Flight(MadeLog({"vehicle_status": FLOWN, **topics}))

    flags = states(fd_critical_failure=[(0, 0), (42, 1), (43, 0)], fd_motor_failure=[(0, 0), (41, 1)])
    assert flown(failsafe_flags=flags).detected_s((10.0, 60.0)) == 41.0
    assert flown(failsafe_flags=flags).detected_s((10.0, 30.0)) is None
    assert flown().detected_s((10.0, 60.0)) is None


def test_newer_firmware_tells_of_the_heading_in_place_of_the_compass() -> None:
    ratios = states(hdg_test_ratio=[(0, 0.1), (30, 1.4), (36, 0.2)])
    health = examine(Px4Flight(MadeLog({"vehicle_status": FLOWN, "estimator_status": ratios})))
    assert [(one.kind, one.title) for one in health.findings] == [("compass", "estimator rejects heading")]


def test_a_height_is_that_above_where_it_was_armed() -> None:
    flight = Px4Flight(MadeLog({
        "vehicle_status": FLOWN,
        "vehicle_local_position": states(z=[(0, 0.0), (5, -30.0), (20, -35.0)]),
    }))  # fmt: skip
    assert flight.armed == ((10.0, 50.0),)
    assert flight.height_m(30.0) == 5.0, "carried uphill before it was armed"


def test_every_field_that_is_read_is_in_the_dictionary() -> None:
    unknown = {
        f"{topic}.{name}"
        for topic, fields in reads().items()
        for name in fields
        if find_field(MESSAGES, topic.partition("#")[0], name) is None
    }
    assert not unknown


def test_a_former_name_means_what_todays_does() -> None:
    assert find_field(MESSAGES, "sensor_gps", "lat") == find_field(MESSAGES, "sensor_gps", "latitude_deg")
    assert find_field(MESSAGES, "sensor_gps", "nonsense") is None


def found_in(topics: Mapping[str, Table], **settings: float) -> list[tuple[str, str, float]]:
    """Kind, title and onset of what is found in a flight with these topics."""
    parameters = {name: (Setting(name, value, "PX4 parameters"),) for name, value in settings.items()}
    log = MadeLog({"vehicle_status": FLOWN, **topics}, parameters=parameters)
    return [(one.kind, one.title, round(one.onset_s, 1)) for one in examine(Px4Flight(log)).findings]


def test_vibration_counts_where_it_lasts() -> None:
    def shaken(force: float, rate: float, until_s: float) -> list[tuple[str, str, float]]:
        return found_in({"vehicle_imu_status": states(
            accel_vibration_metric=[(0, 0.3), (30, force), (until_s, 0.3)],
            gyro_vibration_metric=[(0, 0.02), (30, rate), (until_s, 0.02)],
        )})  # fmt: skip

    assert shaken(25.0, 0.02, 40.0) == [("vibration", "strong vibration", 28.5)]
    assert shaken(0.3, 0.9, 40.0) == [("imu", "noisy gyros", 28.5)]
    assert shaken(9.0, 0.5, 40.0) == []
    assert shaken(2800.0, 50.0, 40.0) == [], "no sensor measures that"
    assert shaken(80.0, 5.0, 31.0) == [], "a hard landing"


@pytest.mark.parametrize(
    ("before", "start_s", "until_s", "found"),
    [(1.5, 30, 45, True), (2.5, 30, 45, False), (1.5, 30, 36, False), (1.5, 16, 45, False)],
    ids=["rose", "as it always shook", "for a moment", "from the take-off on"],
)
def test_vibration_that_rose_in_flight_counts_below_what_is_too_much_of_any(
    before: float, start_s: float, until_s: float, found: bool
) -> None:
    heights = states(x=[(0, 0.0)], y=[(0, 0.0)], z=[(0, 0.0), (12, -10.0), (48, 0.0)])
    shaken = states(accel_vibration_metric=[(0, 0.1), (12, before), (start_s, 6.0), (until_s, before)])
    told = found_in({"vehicle_local_position": heights, "vehicle_imu_status": shaken})
    rose = [("vibration", "vibration that rose in flight", start_s - 1.5)]
    assert [one for one in told if one[0] == "vibration"] == (rose if found else [])


@pytest.mark.parametrize(("start_s", "severity"), [(20, "warning"), (53, "critical")], ids=["in flight", "at rest"])
def test_what_shakes_though_nothing_moves_it_is_a_sensor(start_s: float, severity: str) -> None:
    shaken = states(accel_vibration_metric=[(0, 0.3), (start_s, 15.0), (start_s + 5, 0.3)])
    found = examine(Px4Flight(MadeLog({"vehicle_status": FLOWN, "vehicle_imu_status": shaken}))).findings
    assert [(one.title, one.severity) for one in found] == [("strong vibration", severity)]


def test_a_barometer_is_held_against_what_it_was_before_arming() -> None:
    def heard(after_m: float) -> list[tuple[str, str, float]]:
        t = np.arange(0.0, 60.0, 0.1)
        noise_m = np.where(t < 20.0, 0.1, after_m)
        height = 100.0 + noise_m * np.random.default_rng(0).standard_normal(len(t))
        return found_in({"vehicle_air_data": Table(t, {"baro_alt_meter": height})})

    ((kind, title, onset_s),) = heard(2.0)
    assert (kind, title) == ("barometer", "the barometer is noisy")
    assert 20.0 <= onset_s <= 23.0
    assert heard(0.2) == []


@pytest.mark.parametrize(
    ("poor_s", "accuracy_m", "satellites", "settings", "is_told"),
    [
        ((30, 45), 10.8, 10, {}, True),
        ((30, 45), 0.9, 4, {}, True),
        ((30, 32), 10.8, 4, {}, False),
        ((15, 45), 10.8, 4, {}, False),
        ((30, 45), 4.0, 10, {"EKF2_REQ_EPH": 5.0}, False),
        ((30, 45), 0.9, 5, {"EKF2_REQ_NSATS": 4.0}, False),
    ],
    ids=["accuracy", "satellites", "for a moment", "from its first seconds on", "allowed accuracy", "allowed number"],
)
def test_a_receiver_that_was_good_enough_and_is_no_longer(
    poor_s: tuple[float, float], accuracy_m: float, satellites: int, settings: dict[str, float], is_told: bool
) -> None:
    start_s, end_s = poor_s
    first_s = start_s - (6.0 if start_s < 20 else 25.0)
    told = states(
        fix_type=[(first_s, 3)],
        eph=[(first_s, 0.9), (start_s, accuracy_m), (end_s, 0.9)],
        satellites_used=[(first_s, 10), (start_s, satellites), (end_s, 10)],
    )
    told = told.where(told.t >= first_s)
    log = MadeLog(
        {"vehicle_status": FLOWN, "vehicle_gps_position": told},
        parameters={name: (Setting(name, value, "PARM"),) for name, value in settings.items()},
    )
    found = [one for one in examine(Px4Flight(log)).findings if one.kind == "gps"]
    assert [one.title for one in found] == (["GPS reception became poor"] if is_told else [])


QUAD = {f"CA_ROTOR{n}_P{axis}": at for n, (x, y) in enumerate(((1, 1), (-1, -1), (1, -1), (-1, 1)))
        for axis, at in (("X", float(x)), ("Y", float(y)))} | {"CA_ROTOR_COUNT": 4.0}  # fmt: skip


def test_a_fall_without_a_blow_names_the_motor_that_gave_way() -> None:
    def fallen(lies: bool) -> list[str]:
        t = np.arange(0.0, 60.0, 0.1)
        z = np.interp(t, [0, 12, 20, 30, 32, 60], [0, 0, -10, -10, 0, 0 if lies else -12])
        vz = np.gradient(z, 0.1)
        motors = {f"control[{n}]": [(0, 0.0), (10, 0.5), (29.5, 1.0 if n == 2 else 0.4)] for n in range(4)}
        return [title for _, title, _ in found_in({
            "vehicle_local_position": Table(t, {"z": z, "vz": vz}),
            "actuator_motors": states(**motors),
        }, **QUAD)]  # fmt: skip

    assert fallen(lies=True) == ["motor 3 (front left) gave too little thrust"]
    assert "it hit the ground" not in " ".join(fallen(lies=False)), "it climbed again"


@pytest.mark.parametrize(
    ("mode", "field", "stick", "is_steered"),
    [(15, "z", 0.1, True), (15, "throttle", -0.8, True), (15, "z", 0.5, False), (2, "z", 0.1, False)],
)
def test_a_stick_that_is_the_thrust_and_down_steers_into_the_ground(
    mode: int, field: str, stick: float, is_steered: bool
) -> None:
    t = np.arange(0.0, 60.0, 0.1)
    z = np.interp(t, [0, 12, 20, 30, 32, 60], [0, 0, -10, -10, 0, 0])
    found = found_in({
        "vehicle_local_position": Table(t, {"z": z, "vz": np.gradient(z, 0.1)}),
        "vehicle_status": states(nav_state=[(0, mode)], arming_state=[(0, 1), (5, 2)]),
        "manual_control_setpoint": Table(t, {field: np.where(t > 29.0, stick, 0.0 if field == "throttle" else 0.5)}),
    }, **QUAD)  # fmt: skip
    assert (STEERED in [title for _, title, _ in found]) == is_steered


def test_a_failsafe_that_only_warns_is_not_said_to_have_acted() -> None:
    def told(*said: str) -> list[str]:
        status = states(arming_state=[(0, 2)], failsafe=[(0, 0)])
        spoken = words(*((30.0, "WARNING", text) for text in said))
        return texts(examine(Px4Flight(MadeLog({"vehicle_status": status, "logged_messages": spoken}))), "failsafe")

    assert told("Failsafe warning", "[failsafe] Failsafe activated") == ["Failsafe warning"]
    assert told("[failsafe] Failsafe activated") == ["Failsafe activated"]


@pytest.mark.parametrize(("down_s", "mode", "idled"), [(29.0, 0, True), (30.2, 0, False), (29.0, 2, False)])
def test_motors_that_idle_with_the_stick_down_hold_no_attitude(down_s: float, mode: int, idled: bool) -> None:
    t = np.arange(0.0, 60.0, 0.1)
    half = np.radians(np.interp(t, [30, 31, 60], [0, 80, 80])) / 2
    level = {"q_d[0]": np.ones(len(t)), **{f"q_d[{n}]": np.zeros(len(t)) for n in (1, 2, 3)}}
    found = found_in({
        "vehicle_attitude": Table(t, {"q[0]": np.cos(half), "q[1]": np.sin(half), "q[2]": 0 * t, "q[3]": 0 * t}),
        "vehicle_attitude_setpoint": Table(t, level),
        "vehicle_status": states(nav_state=[(0, mode)], arming_state=[(0, 1), (5, 2)]),
        "vehicle_land_detected": states(landed=[(0, 1), (12, 0)]),
        "vehicle_local_position": states(z=[(0, 0.0), (12, -10.0)]),
        "manual_control_setpoint": Table(t, {"z": np.where(t > down_s, 0.0, 0.5)}),
    }, **QUAD)  # fmt: skip
    (title,) = (title for kind, title, _ in found if kind == "attitude")
    assert title == (IDLED if idled else "control was lost")


def test_the_bare_denial_is_told_only_where_nothing_else_is() -> None:
    def refused(*said: str) -> list[str]:
        status = states(arming_state=[(0, 1)], nav_state=[(0, 4)])
        spoken = words(*((float(n), "WARNING", text) for n, text in enumerate(said)))
        health = examine(Px4Flight(MadeLog({"vehicle_status": status, "logged_messages": spoken})))
        return [one.title for one in health.findings]

    denied = "[commander] Arming denied: Resolve system health failures first"
    assert refused("Arming check: Gyro 1 missing", denied) == ["not ready to fly: Gyro 1 missing"]
    assert refused(denied) == ["not ready to fly: Arming denied: Resolve system health failures first"]


def test_a_battery_is_told_by_its_charge_and_by_its_fall_under_load() -> None:
    def flown(charge: float, loaded_v: float) -> list[tuple[str, str, float]]:
        return found_in({
            "vehicle_local_position": states(z=[(0, 0.0), (20, -10.0), (48, 0.0)]),
            "battery_status": states(voltage_v=[(0, 16.5), (19, loaded_v), (40, loaded_v - 0.1)],
                                     current_a=[(0, 0.5), (19, 20.0)], remaining=[(0, charge), (30, charge - 0.1)]),
        }, BAT1_N_CELLS=4.0)  # fmt: skip

    assert flown(1.0, 16.1) == []
    assert flown(0.3, 16.1) == [("battery", "the battery was only partly charged", 10.0)]
    assert flown(1.0, 12.5) == [("battery", "the battery's voltage falls under load", 10.0)]


def test_a_battery_that_runs_down_in_the_air_is_told_and_one_with_fewer_cells_than_are_set() -> None:
    def flown(rest_v: float, least_v: float, level: int) -> list[tuple[str, str]]:
        log = MadeLog({
            "vehicle_status": FLOWN,
            "vehicle_local_position": states(z=[(0, 0.0), (20, -10.0), (48, 0.0)]),
            "battery_status": states(voltage_v=[(0, rest_v), (30, least_v)], current_a=[(0, 0.5), (19, 20.0)],
                                     remaining=[(0, 0.9)], warning=[(0, 0), (30, level)]),
        }, parameters={"BAT1_N_CELLS": (Setting("BAT1_N_CELLS", 4.0, "PX4 parameters"),)})  # fmt: skip
        return [(one.title, one.severity) for one in examine(Px4Flight(log)).findings]

    assert flown(16.4, 14.0, 2) == []
    assert flown(16.4, 13.2, 3) == [("the battery ran down to its emergency level", "warning")]
    assert flown(16.4, 10.0, 3) == [("the battery ran down to its emergency level", "critical")]
    assert flown(11.6, 9.9, 3) == [("the battery has fewer cells than are set", "warning")]
    assert flown(25.0, 24.0, 0) == [("the battery has more cells than are set", "warning")]
    assert flown(17.4, 16.8, 0) == []  # cells of high voltage are full at 4.35 V


@pytest.mark.parametrize("says", ["Found 0 compass (required: 1)", "Compass Sensor 0 missing", "Compass 1 missing"])
def test_a_compass_that_is_missing_was_to_be_simulated(says: str) -> None:
    assert "SENS_EN_MAGSIM" in read_by(says)


def kept_for_its_charge(cells: float, empty_v: float, full_v: float) -> list[tuple[str, str, tuple[str, ...]]]:
    """What is found of a vehicle that shuts itself down before anybody armed it, for a charge of nothing."""
    values = {"BAT1_N_CELLS": (cells, 0.0), "BAT1_V_EMPTY": (empty_v, 3.6), "BAT1_V_CHARGED": (full_v, 4.05)}
    parameters = {name: (Setting(name, value, "ulog", default),) for name, (value, default) in values.items()}
    log = MadeLog({
        "vehicle_status": states(arming_state=[(0, 1)], nav_state=[(0, 4)]),
        "battery_status": Table(np.array([0.6, 1.2]), {
            "voltage_v": np.array([16.6, 16.6]), "current_a": np.array([0.4, 0.4]), "remaining": np.zeros(2),
        }),
        "logged_messages": words((1.4, "WARNING", "Arming check: Low battery level")),
    }, parameters=parameters)  # fmt: skip
    findings = examine(Px4Flight(log)).findings
    return [(one.title, one.severity, one.parameters) for one in findings if one.kind == "battery"]


def test_a_sound_battery_that_keeps_it_from_arming_is_told_with_what_was_set() -> None:
    title = "the battery is told to be empty, and is not"
    assert kept_for_its_charge(4, 3.6, 4.05) == []  # it says no more than that it is low
    assert kept_for_its_charge(4, 7.5, 4.05) == [(title, "critical", ("BAT1_V_EMPTY",))]
    assert kept_for_its_charge(4, 3.6, 9.0) == [(title, "critical", ("BAT1_V_CHARGED",))]
    assert kept_for_its_charge(5, 7.5, 4.05) == []  # 3.3 V a cell is empty indeed
    fewer = "the battery has fewer cells than are set"
    assert kept_for_its_charge(14, 3.6, 4.05) == [(fewer, "critical", ("BAT1_N_CELLS",))]


@pytest.mark.parametrize(
    ("limit_deg", "leans_deg", "named"), [(13.0, 24.0, ("FD_FAIL_P",)), (60.0, 24.0, ()), (13.0, 80.0, ())]
)
def test_a_failure_detector_that_acts_on_what_it_may_lean(
    limit_deg: float, leans_deg: float, named: tuple[str, ...]
) -> None:
    half = np.radians(leans_deg) / 2
    parameters = {"FD_FAIL_R": set_to(60.0), "FD_FAIL_P": set_to(limit_deg), "MPC_TILTMAX_AIR": set_to(45.0)}
    log = MadeLog({
        "vehicle_status": FLOWN,
        "failsafe_flags": states(fd_critical_failure=[(0, 0), (30, 1), (31, 0)]),
        "vehicle_attitude": states(**{"q[0]": [(0, 1.0), (30, float(np.cos(half))), (31, 1.0)],
                                      "q[1]": [(0, 0.0)],
                                      "q[2]": [(0, 0.0), (30, float(np.sin(half))), (31, 0.0)], "q[3]": [(0, 0.0)]}),
    }, parameters=parameters)  # fmt: skip
    (finding,) = [one for one in examine(Px4Flight(log)).findings if "failure detector" in one.title]
    assert finding.parameters == named


@pytest.mark.parametrize(
    ("least_v", "after_v", "ampere", "title"),
    [
        (14.8, 15.6, 0.0, "the battery was told to be empty, and was not"),
        (14.8, 15.0, 0.0, "the battery ran down to its emergency level"),
        (13.2, 15.6, 20.0, "the battery ran down to its emergency level"),  # it sags as no sound one does
    ],
)
def test_a_battery_whose_gauge_says_empty(least_v: float, after_v: float, ampere: float, title: str) -> None:
    log = MadeLog({
        "vehicle_status": FLOWN,
        "vehicle_local_position": states(z=[(0, 0.0), (20, -10.0), (48, 0.0)]),
        "battery_status": states(voltage_v=[(0, 16.0), (30, least_v), (50, after_v)],
                                 current_a=[(0, 0.0), (19, ampere), (50, 0.0)],
                                 remaining=[(0, 0.6)], warning=[(0, 0), (30, 3)]),
    }, parameters={name: (Setting(name, value, "PX4 parameters"),)
                   for name, value in (("BAT1_N_CELLS", 4.0), ("BAT1_V_EMPTY", 3.8))})  # fmt: skip
    found = [one for one in examine(Px4Flight(log)).findings if one.kind == "battery"]
    assert [one.title for one in found] == [title]
    assert ("no current tells" in found[0].evidence) is ("was not" in title)
    assert found[0].parameters == (("BAT1_V_EMPTY",) if "was not" in title else ())


def test_a_battery_that_keeps_it_from_arming_is_the_battery() -> None:
    health = examine(Px4Flight(MadeLog({
        "vehicle_status": states(arming_state=[(0, 1)], nav_state=[(0, 4)]),
        "battery_status": states(voltage_v=[(0, 14.5)], current_a=[(0, 0.5)], remaining=[(0, 0.06)]),
        "logged_messages": words((1.0, "ERROR", "[health_and_arming_checks] Low battery level\t"),
                                 (9.0, "WARNING", "[commander] Arming denied: Resolve system health failures first")),
    })))  # fmt: skip
    found = {one.title for root in health.findings for one in (root, *root.below)}
    assert {"the battery was only partly charged", "not ready to fly: Low battery level"} <= found


def test_a_rover_that_is_driven_and_stands_is_told_with_what_its_driver_says() -> None:
    t = np.arange(0.0, 50.0, 0.1)
    still = np.zeros_like(t)
    topics = {
        "vehicle_status": states(arming_state=[(0, 1), (5, 2), (45, 1)], vehicle_type=[(0, 3), (1, 3)]),
        "actuator_motors": Table(t, {f"control[{n}]": np.where(t < 40.0, 0.4, 0.0) for n in range(2)}),
        "vehicle_local_position": Table(
            t, {"vx": np.where(t < 20.0, 0.3, 0.0), "vy": still, "heading": still, "z": still}
        ),
        "logged_messages": words(*((10.0 + n / 10, "ERROR", f"[roboclaw] ACK timeout {n}") for n in range(200))),
    }
    blocked, repeated = examine(Px4Flight(MadeLog(topics))).findings
    assert (blocked.title, blocked.suspect) == ("the vehicle is driven and does not move", "hardware")
    assert "roboclaw: ACK timeout N (100 times)" in blocked.evidence
    assert repeated.title == "the firmware repeats an error: roboclaw: ACK timeout N"
    drives = {**topics["vehicle_local_position"].columns, "vx": still + 0.3}
    moving = examine(Px4Flight(MadeLog({**topics, "vehicle_local_position": Table(t, drives)})))
    assert [one.kind for one in moving.findings] == ["software"]


def test_what_is_no_rotation_is_no_attitude() -> None:
    q = {"q[0]": np.array([1.0, np.inf, 1e300, 0.0]), **{f"q[{n}]": np.zeros(4) for n in (1, 2, 3)}}
    lean = lean_of(Table(np.arange(4.0), q), None)
    assert lean is not None
    assert lean.tilt_deg[0] == 0.0
    assert np.isnan(lean.tilt_deg[1:]).all()

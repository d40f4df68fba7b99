"""What PX4's parameters say of rotors, outputs and preflight checks, where it cannot be."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from care_core.ecosystems.findings import Finding
from care_core.ecosystems.px4.checks import arming, calibration, rotors
from care_core.ecosystems.px4.flight import MESSAGES, STATUS, Px4Flight
from care_core.ecosystems.px4.preflight import read_by
from care_core.records import replace
from care_core.run import Setting
from tests.unit.test_px4_health import FLOWN, MadeLog, states, words

SIMULATED = {"stack": "PX4", "firmware": "PX4 v1.15.4 (99c40407)", "vehicle": "multicopter", "hardware": "PX4_SITL"}
PLACES = ((1.0, 1.0, 0.05), (-1.0, -1.0, 0.05), (1.0, -1.0, -0.05), (-1.0, 1.0, -0.05))
"""North, east and turn of the rotors of a quad X."""


def quad(**changed: float) -> dict[str, tuple[Setting, ...]]:
    """The parameters of a quad X with their airframe's defaults, some of them changed."""
    default = {"CA_AIRFRAME": 0.0, "CA_ROTOR_COUNT": 4.0}
    for n, (north, east, turn) in enumerate(PLACES):
        fields = {"PX": north, "PY": east, "AX": 0.0, "AY": 0.0, "AZ": -1.0, "KM": turn, "CT": 6.5}
        default |= {f"CA_ROTOR{n}_{field}": value for field, value in fields.items()}
        default[f"PWM_MAIN_FUNC{n + 1}"] = 101.0 + n
    return {name: (Setting(name, changed.get(name, value), "ulog", value),) for name, value in default.items()}


def flight(parameters: Mapping[str, tuple[Setting, ...]]) -> Px4Flight:
    return Px4Flight(MadeLog({STATUS: FLOWN}, parameters=parameters))


def refused(reason: str, parameters: Mapping[str, tuple[Setting, ...]], *, is_simulated: bool = False) -> Finding:
    """What is found of a vehicle that a preflight check kept from arming."""
    said = words(
        (5.0, "critical", f"Preflight Fail: {reason}"),
        (6.0, "critical", "Arming denied: Resolve system health failures first"),
    )
    tables = {STATUS: states(arming_state=[(0, 1)], nav_state=[(0, 4)]), MESSAGES: said}
    log = MadeLog(tables, parameters=parameters)
    (found,) = arming.find(Px4Flight(replace(log, facts=SIMULATED) if is_simulated else log))
    return found


def test_a_frame_that_balances_says_nothing() -> None:
    assert not list(rotors.find(flight(quad())))


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("CA_ROTOR2_KM", 0.05, "3 rotors that turn one way and 1 the other"),
        ("CA_ROTOR0_PX", -1.0, "lift off the middle"),
        ("CA_ROTOR1_CT", -6.5, "lifts nothing, or downwards"),
        ("CA_ROTOR2_CT", 1.1, "one rotor that lifts 0.17 times"),
        ("CA_ROTOR3_AZ", 1.0, "lift up and down"),
        ("CA_ROTOR0_AY", 0.5, "one rotor that is tilted"),
    ],
)
def test_a_rotor_that_cannot_be_is_named_with_its_airframes_value(name: str, value: float, says: str) -> None:
    (found,) = rotors.find(flight(quad(**{name: value})))
    (default,) = quad()[name]
    assert (found.parameters, found.wanted) == ((name,), ((name, default.default),))
    assert says in found.evidence


def test_what_an_airframe_is_shipped_with_is_not_doubted() -> None:
    odd = {name: (Setting(name, 0.05, "ulog", 0.05),) for name in ("CA_ROTOR2_KM", "CA_ROTOR3_KM")}
    assert not list(rotors.find(flight(quad() | odd)))


def test_a_motor_that_no_output_drives_is_named() -> None:
    (found,) = rotors.find(flight(quad(PWM_MAIN_FUNC3=0.0)))
    assert (found.title, found.wanted) == ("no output drives motor 3", (("PWM_MAIN_FUNC3", 103.0),))


def test_a_check_that_refuses_names_what_it_reads_where_that_is_off() -> None:
    said = "Parachute system missing"
    found = refused(said, {"COM_PARACHUTE": (Setting("COM_PARACHUTE", 1.0, "ulog", 0.0),)})
    assert (found.parameters, found.wanted) == (("COM_PARACHUTE",), ())  # a protection is not made looser
    assert found.evidence.endswith("COM_PARACHUTE is 1 (default 0): check it first")
    found = refused(said, {"COM_PARACHUTE": (Setting("COM_PARACHUTE", 1.0, "ulog", 1.0),)})  # as shipped
    assert (found.parameters, found.suspect) == ((), "operation")


def test_what_is_wired_is_put_back_where_a_check_refuses_for_it() -> None:
    off = {"SYS_HAS_MAG": (Setting("SYS_HAS_MAG", 4.0, "ulog", 1.0),)}
    found = refused("Found 1 compass (required: 4)", off)
    assert found.wanted == (("SYS_HAS_MAG", 1.0),)
    assert found.evidence.endswith("SYS_HAS_MAG is 4 (default 1): 'param set SYS_HAS_MAG 1' puts it back")


@pytest.mark.parametrize(
    ("says", "reads"),
    [
        ("ESC telemetry missing", "COM_ARM_CHK_ESCS"),
        ("Found 1 compass (required: 4)", "SYS_HAS_MAG"),
        ("barometer 0 missing", "SYS_HAS_BARO"),
        ("Not enough GPS Satellites", "EKF2_REQ_NSATS"),
        ("Vehicle is in safety configuration", "COM_ARMABLE"),
        ("Preflight Fail: ekf2 missing data", "CAL_ACC0_ZSCALE"),
    ],
)
def test_a_refusal_is_known_by_its_words(says: str, reads: str) -> None:
    assert reads in read_by(says)


def test_a_frame_that_control_allocation_does_not_know_is_named() -> None:
    said = words((1.0, "error", "[control_allocator] Actuator effectiveness init failed"))
    tables = {STATUS: FLOWN, MESSAGES: said}
    (found,) = rotors.find(Px4Flight(MadeLog(tables, parameters=quad(CA_AIRFRAME=6.0))))
    assert (found.parameters, found.wanted) == (("CA_AIRFRAME",), (("CA_AIRFRAME", 0.0),))
    assert not list(rotors.find(Px4Flight(MadeLog(tables, parameters=quad()))))


def test_more_rotors_than_outputs_are_as_many_as_the_airframe_has() -> None:
    (found,) = rotors.find(flight(quad(CA_ROTOR_COUNT=6.0)))
    assert found.wanted == (("CA_ROTOR_COUNT", 4.0),)
    assert found.evidence.startswith("4 of 6 are driven")


def calibrated(**values: float) -> dict[str, tuple[Setting, ...]]:
    """PX4 writes calibrations itself: a log says that their defaults are what they are."""
    used = {f"{name.rpartition('_')[0]}_ID": 1310988.0 for name in values} | values
    return {name: (Setting(name, value, "ulog", value),) for name, value in used.items()}


@pytest.mark.parametrize(
    ("name", "value", "sound", "is_simulated"),
    [
        ("CAL_ACC0_XSCALE", 3.0, 1.0, False),
        ("CAL_ACC1_ZOFF", -1.5, 0.0, True),
        ("CAL_GYRO0_YOFF", 0.7, 0.0, False),
        ("CAL_MAG0_XOFF", 3.5, 0.0, False),
        ("CAL_MAG2_YODIAG", -0.9, 0.0, False),
    ],
)
def test_a_calibration_that_no_sensor_needs_is_named(name: str, value: float, sound: float, is_simulated: bool) -> None:
    log = MadeLog({STATUS: FLOWN}, parameters=calibrated(**{name: value}))
    (found,) = calibration.find(Px4Flight(replace(log, facts=SIMULATED) if is_simulated else log))
    assert (found.parameters, found.suspect, found.wanted) == ((name,), "parameter", ())
    assert found.evidence == f"{name} is {value:g}, where {sound:g} corrects nothing"


def test_what_real_sensors_need_and_the_calibration_of_none_are_not_doubted() -> None:
    real = calibrated(
        CAL_ACC1_XOFF=3.8, CAL_ACC0_XSCALE=1.06, CAL_GYRO0_ZOFF=0.12, CAL_MAG0_XOFF=1.15, CAL_MAG0_ZSCALE=0.12
    )
    absent = calibrated(CAL_ACC2_XSCALE=3.0) | {"CAL_ACC2_ID": (Setting("CAL_ACC2_ID", 0.0, "ulog", 0.0),)}
    assert not list(calibration.find(flight(real | absent)))


def test_a_refusal_names_the_calibration_that_its_check_reads() -> None:
    found = refused("velocity estimate error", calibrated(CAL_ACC0_ZOFF=1.5), is_simulated=True)
    assert (found.parameters, found.wanted) == (("CAL_ACC0_ZOFF",), ())
    assert found.evidence.endswith("CAL_ACC0_ZOFF is 1.5 (default 0): calibrate again")


def test_a_compass_that_is_left_out_is_named_where_none_is_found() -> None:
    said = "Found 0 compass (required: 1)"
    assert refused(said, calibrated(CAL_MAG0_PRIO=-1.0)).parameters == ("CAL_MAG0_PRIO",)
    assert refused(said, calibrated(CAL_MAG0_PRIO=100.0)).parameters == ()


def fence(**metres: float) -> dict[str, tuple[Setting, ...]]:
    values = {"GF_ACTION": 2.0, "GF_MAX_HOR_DIST": 0.0, "GF_MAX_VER_DIST": 0.0}
    return {name: (Setting(name, metres.get(name, value), "ulog", value),) for name, value in values.items()}


def test_a_fence_that_a_mission_crosses_is_named_and_nothing_of_it_that_is_as_shipped() -> None:
    assert refused("Geofence violation", fence(GF_MAX_HOR_DIST=77.4)).parameters == ("GF_MAX_HOR_DIST",)


def test_a_fence_that_the_airframe_brings_may_refuse_a_mission_too() -> None:
    shipped = fence() | {"GF_MAX_VER_DIST": (Setting("GF_MAX_VER_DIST", 50.0, "ulog", 50.0),)}
    assert refused("Geofence violation", shipped).parameters == ("GF_MAX_VER_DIST",)


def test_what_reads_a_parameter_that_is_off_is_the_reason_that_is_told() -> None:
    said = words(
        (4.0, "critical", "Geofence violation for waypoint 3"),
        (5.0, "critical", "Preflight Fail: GPS Vertical Pos Drift too high"),
        (6.0, "critical", "Arming denied: Resolve system health failures first"),
    )
    tables = {STATUS: states(arming_state=[(0, 1)], nav_state=[(0, 4)]), MESSAGES: said}
    for changed, told in (
        ({"GF_MAX_HOR_DIST": 77.4}, "Geofence violation for waypoint 3"),
        ({}, "Preflight Fail: GPS"),
    ):
        assert Px4Flight(MadeLog(tables, parameters=fence(**changed))).refusals[-1][1].startswith(told)

"""What is known of vehicles: modes, errors, events, motors, names of parameters."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from care_core.ecosystems.vehicles import (
    error_kind,
    error_words,
    event_words,
    is_simulated,
    mode_name,
    mode_number,
    motors_of,
    vehicle_of,
    way_of,
)
from care_core.ecosystems.vehicles.frames import FRAMES, arms_of
from care_core.ecosystems.vehicles.modes import px4_mode
from care_core.ecosystems.vehicles.vehicle import Kind
from care_core.logs.ardupilot import Built, dataflash_facts, facts_of
from care_core.logs.base import Table
from care_core.metadata.aliases import _chains, alias_in, aliases_of, renamed
from care_core.run import Setting

QUAD_X = {"FRAME_CLASS": 1.0, "FRAME_TYPE": 1.0}
QUAD_OUTPUTS = {f"SERVO{n}_FUNCTION": 32.0 + n for n in range(1, 5)}


@pytest.mark.parametrize(
    ("facts", "settings", "kind", "title"),
    [
        ({"firmware": "ArduCopter V4.5.4 (fd1bcc61)"}, QUAD_X, "copter", "ArduCopter V4.5.4, quad X"),
        ({"firmware": "APM:Copter V3.5-dev (591bb324)"}, {}, "copter", "APM:Copter V3.5-dev, multicopter"),
        ({"firmware": "ArduPlane V4.4.0"}, {"Q_ENABLE": 1.0}, "quadplane", "ArduPlane V4.4.0, quadplane"),
        ({"firmware": "ArduPlane V4.4.0"}, {"Q_ENABLE": 0.0}, "plane", "ArduPlane V4.4.0, fixed wing"),
        ({"firmware": "ArduRover V4.5.4"}, {"FRAME_CLASS": 1.0}, "rover", "ArduRover V4.5.4, rover"),
        ({"firmware": "Rover V4.6.0"}, {"FRAME_CLASS": 2.0}, "rover", "Rover V4.6.0, boat"),
        ({"firmware": "ArduCopter V4.6.0"}, {"FRAME_CLASS": 6.0}, "heli", "ArduCopter V4.6.0, helicopter"),
        ({"firmware": "ArduSub V4.1.0"}, {"FRAME_CONFIG": 1.0}, "sub", "ArduSub V4.1.0, submarine, vectored"),
        ({"firmware": "AntennaTracker V4.5.0"}, {}, "tracker", "AntennaTracker V4.5.0, antenna tracker"),
        ({"firmware": "PX4 v1.15.0 (cb09dde6)", "stack": "PX4"}, {}, "px4", "PX4 v1.15.0, unknown vehicle"),
        ({"vehicle": "rover"}, {}, "unknown", "rover"),
        (
            {"firmware": "HawkCopter V4.5.5 (cff126f5), which is ArduCopter 4.5.5"},
            QUAD_X,
            "copter",
            "HawkCopter V4.5.5, which is ArduCopter 4.5.5, quad X",
        ),
        (
            {"firmware": "Hawk V4.5.5 (cff126f5)"},
            {"TRIM_THROTTLE": 45.0, "KFF_RDDRMIX": 0.5},
            "plane",
            "Hawk V4.5.5, fixed wing",
        ),
        (
            {"firmware": "Hawk V4.5.5 (cff126f5)"},
            {"CRUISE_SPEED": 2.0, "CRUISE_THROTTLE": 50.0},
            "rover",
            "Hawk V4.5.5, rover",
        ),
        (
            {"firmware": "Hawk V4.5.5 (cff126f5)"},
            {**QUAD_X, "LAND_SPEED": 50.0, "RTL_CONE_SLOPE": 3.0},
            "copter",
            "Hawk V4.5.5, quad X",
        ),
        (
            {"firmware": "Hawk V4.5.5 (cff126f5)"},
            {"LAND_SPEED": 50.0, "CRUISE_SPEED": 2.0, "SIMPLE": 0.0},
            "unknown",
            "Hawk V4.5.5, unknown vehicle",
        ),
    ],
)
def test_a_vehicle_is_what_its_log_says(facts: dict[str, str], settings: dict[str, float], kind: Kind,
                                        title: str) -> None:  # fmt: skip
    vehicle = vehicle_of(facts, settings)
    assert (vehicle.kind, vehicle.title) == (kind, title)


def test_a_version_is_told_as_far_as_it_is_written() -> None:
    assert vehicle_of({"firmware": "ArduCopter V4.5.4"}, {}).version == (4, 5, 4)
    assert vehicle_of({"firmware": "ArduCopter V3.1 (5c6503e2)"}, {}).version == (3, 1)
    assert vehicle_of({"firmware": "ArduCopter"}, {}).version is None
    assert vehicle_of({"firmware": "Hawk V7.1.0 (cff126f5), which is ArduCopter 4.5.5"}, {}).version == (4, 5, 5)
    assert vehicle_of({"firmware": "Hawk V4.5.5 (cff126f5)"}, {}).version is None  # its vendor counts as it likes


def test_old_firmware_has_no_class_but_its_four_motors_tell_it() -> None:
    facts, settings = {"firmware": "ArduCopter V3.1"}, {"FRAME": 1.0}
    assert vehicle_of(facts, settings).name == "multicopter"
    assert vehicle_of(facts, settings, motors=4).name == "quad X"
    assert not motors_of(settings)
    assert [motor.place for motor in motors_of(settings, motors=4)] == [
        "front right", "rear left", "front left", "rear right",
    ]  # fmt: skip
    assert not motors_of(settings, motors=6)  # a hexa or a Y6


@pytest.mark.parametrize(
    ("kind", "number", "name", "way"),
    [
        ("copter", 3, "Auto", "mission"), ("copter", 5, "Loiter", "hold"), ("copter", 0, "Stabilize", "manual"),
        ("plane", 10, "Auto", "mission"), ("plane", 5, "FBWA", "manual"), ("quadplane", 21, "QRTL", "return"),
        ("rover", 4, "Hold", "hold"), ("rover", 3, "Steering", "manual"), ("sub", 19, "Manual", "manual"),
        ("px4", 3, "Mission", "mission"), ("unknown", 3, "mode 3", "other"), ("copter", 99, "mode 99", "other"),
    ],
)  # fmt: skip
def test_a_mode_number_means_what_its_vehicle_means(kind: Kind, number: int, name: str, way: str) -> None:
    assert (mode_name(kind, number), way_of(kind, number)) == (name, way)


def test_modes_are_known_by_the_names_of_text_logs() -> None:
    assert mode_number("copter", "ALT_HOLD") == 2
    assert mode_number("copter", "OF_LOITER") == 10
    assert mode_number("rover", "ALT_HOLD") is None


def test_a_px4_heartbeat_and_a_px4_log_name_modes_alike() -> None:
    assert mode_name("px4", px4_mode(4 << 16 | 4 << 24)) == "Mission"
    assert mode_name("px4", px4_mode(7 << 16)) == "Stabilized"


@pytest.mark.parametrize(
    ("subsystem", "code", "words", "kind"),
    [
        (6, 1, "battery failsafe", "failsafe"), (5, 0, "radio failsafe over", "failsafe"),
        (12, 1, "crash detected", "crash"), (9, 3, "fence breach (upper altitude, circle)", "failsafe"),
        (24, 1, "estimator switched to lane 1", "ekf"), (7, 1, "no GPS position", ""),
        (77, 2, "error of subsystem 77, code 2", ""),
    ],
)  # fmt: skip
def test_errors_in_words(subsystem: int, code: int, words: str, kind: str) -> None:
    assert (error_words(subsystem, code), error_kind(subsystem)) == (words, kind)


def test_a_refused_mode_is_named_by_its_vehicle() -> None:
    assert error_words(10, 5, "copter") == "Loiter was refused"
    assert error_words(10, 4, "rover") == "Hold was refused"


def test_events_in_words() -> None:
    assert event_words(54) == "motors stopped by the emergency switch"
    assert event_words(250) == "event 250"


@pytest.mark.parametrize(("frame_class", "frame_type"), FRAMES)
def test_every_frame_can_hover(frame_class: int, frame_type: int) -> None:
    """The same thrust of every motor turns a vehicle about no axis."""
    arms = arms_of(frame_class, frame_type).values()
    roll, pitch, yaw = zip(*((arm.roll, arm.pitch, arm.yaw) for arm in arms), strict=True)
    is_tailed = frame_type in (4, 5)  # whose tail leans, so that its rear motors stand further back
    for factors in (roll, yaw) if is_tailed else (roll, pitch, yaw):
        assert sum(factors) == pytest.approx(0.0, abs=1e-3)
        assert max(map(abs, factors)) == pytest.approx(0.5)


def test_every_motor_is_where_its_factors_say() -> None:
    for arms in FRAMES.values():
        for arm in arms.values():
            assert math.copysign(1, arm.roll) == -math.copysign(1, arm.angle_deg) or abs(arm.roll) < 1e-6


def test_outputs_follow_the_functions_that_they_were_given() -> None:
    swapped = {"SERVO1_FUNCTION": 0.0, "SERVO9_FUNCTION": 33.0, "SERVO2_FUNCTION": 34.0, "SERVO3_FUNCTION": 35.0,
               "SERVO4_FUNCTION": 36.0}  # fmt: skip
    assert [motor.output for motor in motors_of(QUAD_X | swapped)] == [9, 2, 3, 4]


def test_settings_with_their_history_will_do() -> None:
    history = {name: (Setting(name, value, "PARM"),) for name, value in (QUAD_X | QUAD_OUTPUTS).items()}
    assert motors_of(history) == motors_of(QUAD_X | QUAD_OUTPUTS) != ()


def test_a_rover_has_no_multicopter_motors() -> None:
    assert not motors_of({"FRAME_CLASS": 1.0, "FRAME_TYPE": 1.0, "SERVO1_FUNCTION": 73.0, "SERVO3_FUNCTION": 74.0})


def test_twelve_motors_and_the_motors_of_a_quadplane() -> None:
    functions = {f"SERVO{n}_FUNCTION": 32.0 + n if n < 9 else 73.0 + n for n in range(1, 13)}
    places = [motor.place for motor in motors_of({"FRAME_CLASS": 12.0, "FRAME_TYPE": 1.0, **functions})]
    assert places[:2] == ["upper front right", "lower front right"]
    assert len(set(places)) == 12
    plane = {"Q_ENABLE": 1.0, "Q_FRAME_CLASS": 1.0, "Q_FRAME_TYPE": 3.0,
             **{f"SERVO{n + 4}_FUNCTION": 32.0 + n for n in range(1, 5)}}  # fmt: skip
    assert [motor.output for motor in motors_of(plane)] == [5, 6, 7, 8]


def test_no_two_motors_share_a_place_unless_the_tables_do_not_say_which_is_above() -> None:
    for (frame_class, frame_type), arms in FRAMES.items():
        outputs = {f"SERVO{n}_FUNCTION": 32.0 + n if n < 9 else 73.0 + n for n in arms}
        motors = motors_of({"FRAME_CLASS": float(frame_class), "FRAME_TYPE": float(frame_type), **outputs})
        assert len(motors) == len(arms)
        if frame_class != 5 and (frame_class, frame_type) != (1, 19) and frame_type not in (4, 5):
            assert len({motor.place for motor in motors}) == len(motors)


@pytest.mark.parametrize(
    ("name", "version", "now", "scale"),
    [
        ("GPS_DELAY_MS", (4, 6), "GPS1_DELAY_MS", 1.0), ("GPS2_POS_X", (4, 5), "GPS_POS2_X", 1.0),
        ("WPNAV_SPEED", (4, 5, 4), "WPNAV_SPEED", 1.0), ("WPNAV_SPEED", (4, 7, 0), "WP_SPD", 0.01),
        ("WP_SPD", (4, 6), "WPNAV_SPEED", 100.0), ("PSC_VELXY_P", (4, 7), "PSC_NE_VEL_P", 1.0),
        ("PSC_NE_VEL_P", (3, 5), "VEL_XY_P", 1.0), ("LAND_SPEED", (4, 7), "LAND_SPD_MS", 0.01),
        ("PSC_JERK_XY", (4, 7, 1), "PSC_NE_JERK", 1.0), ("ANGLE_MAX", (4, 7), "ATC_ANGLE_MAX", 0.01),
        ("PSC_ACCZ_IMAX", (4, 7), "PSC_D_ACC_IMAX", 0.001), ("MOT_SPIN_MAX", (4, 7), "MOT_SPIN_MAX", 1.0),
        ("BATT_LOW_VOLT", (3, 5), "FS_BATT_VOLTAGE", 1.0),
    ],
)  # fmt: skip
def test_renamed(name: str, version: tuple[int, ...], now: str, scale: float) -> None:
    alias = renamed(name, version)
    assert alias.name == now
    assert alias.scale == pytest.approx(scale)


def test_rovers_and_planes_keep_their_own_names() -> None:
    assert renamed("WP_SPEED", (4, 7), "rover").name == "WP_SPEED"
    assert renamed("RTL_ALT", (4, 7), "plane").name == "RTL_ALT"
    assert renamed("Q_ANGLE_MAX", (4, 7), "quadplane").name == "Q_A_ANGLE_MAX"


def test_a_log_is_asked_which_name_it_holds() -> None:
    """A development version has the next number before it has the next names."""
    held = alias_in("WP_SPD", {"WPNAV_SPEED", "RTL_ALT"})
    assert held is not None
    assert held.name == "WPNAV_SPEED"
    assert held.scale == pytest.approx(100.0)
    assert alias_in("WP_SPD", {"RTL_ALT"}) is None


@pytest.mark.parametrize("kind", ["copter", "quadplane", "rover"])
def test_every_name_belongs_to_one_parameter(kind: Kind) -> None:
    for name, chain in _chains(kind).items():
        assert name in {alias.name for alias in chain}
        assert all(earlier.since < later.since for earlier, later in pairwise(chain))
        assert all(len(alias.name) <= 16 for alias in chain)  # AP_MAX_NAME_SIZE
        assert aliases_of(name, kind)[0].name == chain[0].name


def ver(build: float, *version: float) -> Table:
    columns = dict(zip(("BU", "Maj", "Min", "Pat"), map(np.atleast_1d, (build, *version)), strict=True))
    return Table(np.zeros(1), {"FWS": np.array(["HawkOS V2.1 (cff126f5)"], dtype=object), **columns})


@pytest.mark.parametrize(
    ("build", "version", "firmware", "vehicle"),
    [
        (2.0, (4.0, 5.0, 5.0), "HawkOS V2.1 (cff126f5), which is ArduCopter 4.5.5", "multicopter"),
        (1.0, (4.0, 6.0, 0.0), "HawkOS V2.1 (cff126f5), which is ArduRover 4.6.0", "rover"),
        (13.0, (4.0, 5.0, 0.0), "HawkOS V2.1 (cff126f5), which is ArduCopter 4.5.0", "helicopter"),
        (2.0, (2.0, 1.0, 0.0), "HawkOS V2.1 (cff126f5), which is ArduCopter", "multicopter"),  # the vendor's number
        (99.0, (4.0, 5.0, 5.0), "HawkOS V2.1 (cff126f5)", None),
        (np.nan, (np.nan, 5.0, 5.0), "HawkOS V2.1 (cff126f5)", None),
    ],
)
def test_firmware_under_another_name_is_what_was_built(
    build: float, version: tuple[float, ...], firmware: str, vehicle: str | None
) -> None:
    facts = dataflash_facts({"VER": ver(build, *version)})
    assert (facts["firmware"], facts.get("vehicle")) == (firmware, vehicle)


def test_firmware_by_its_own_name_keeps_it() -> None:
    texts = Table(
        np.zeros(2), {"Message": np.array(["ArduPlane V4.5.5 (cff126f5)", "u-blox 1 SW: 3.01 (107900)"], object)}
    )
    assert dataflash_facts({"MSG": texts})["firmware"] == "ArduPlane V4.5.5 (cff126f5)"


def test_telemetry_names_the_firmware_by_its_heartbeats() -> None:
    built = Built("multicopter", "ArduCopter V4.5.5 (cff126f5)")
    assert facts_of(["Hawk V4.5.5 (cff126f5)"], built)["firmware"].endswith(", which is ArduCopter V4.5.5 (cff126f5)")
    assert facts_of([], built)["firmware"] == "ArduCopter V4.5.5 (cff126f5)"


@pytest.mark.parametrize(
    ("hardware", "hitl", "simulated"), [("PX4_SITL", 0, True), ("FMU", 1, True), ("FMU", 0, False)]
)
def test_a_board_that_flies_in_a_simulator_is_simulated(hardware: str, hitl: int, simulated: bool) -> None:
    assert is_simulated({"stack": "PX4", "hardware": hardware}, {"SYS_HITL": float(hitl)}) is simulated

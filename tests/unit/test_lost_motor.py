"""Which motor gave way, by simulated flights of many frames under both firmwares; and what names none."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
import pytest

from care_core.ecosystems.ardupilot.examining import find
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.findings import Finding, every_finding
from care_core.ecosystems.px4.examining import examine
from care_core.ecosystems.px4.flight import Px4Flight
from care_core.ecosystems.vehicles import Motor
from care_core.numbers import Floats
from care_core.run import Setting
from tests.falls import ARMED_S, FAILS_S, Fall, dataflash_log, efficiency, fly, frame, px4_log, settings

QUAD_X, QUAD_PLUS, HEXA_X, OCTA_PLUS, Y6 = (1, 1), (1, 0), (2, 1), (3, 0), (5, 0)


@lru_cache(maxsize=8)
def cut(kind: tuple[int, int], motor: int, share: float = 0.0) -> Fall:
    return fly(frame(*kind), efficiency(motor, share))


def geometry(motors: Sequence[Motor]) -> dict[str, float]:
    """The rotors as PX4's control allocation has them."""
    places = {
        f"CA_ROTOR{n}_P{axis}": float(turn(np.radians(motor.angle_deg)))
        for n, motor in enumerate(motors)
        for axis, turn in (("X", np.cos), ("Y", np.sin))
    }
    return {"CA_ROTOR_COUNT": float(len(motors)), **places}


def frame_settings(kind: tuple[int, int], *changed: Setting) -> dict[str, tuple[Setting, ...]]:
    motors = {f"SERVO{n}_FUNCTION": 32.0 + n for n in range(1, len(frame(*kind)) + 1)}
    range_us = {"MOT_PWM_MIN": 1000.0, "MOT_PWM_MAX": 2000.0, "MOT_SPIN_MAX": 0.95}
    return settings({"FRAME_CLASS": kind[0], "FRAME_TYPE": kind[1], **range_us, **motors}, *changed)


def under_px4(fall: Fall, parameters: dict[str, tuple[Setting, ...]], mode: float = 2.0, every: int = 5,
              pwm: bool = True) -> tuple[Finding, ...]:  # fmt: skip
    return examine(Px4Flight(px4_log(fall, parameters, mode, every, pwm))).findings


def under_ardupilot(fall: Fall, kind: tuple[int, int], *changed: Setting, mode: float = 5.0) -> tuple[Finding, ...]:
    return find(Flight(dataflash_log(fall, frame(*kind), frame_settings(kind, *changed), mode)))


@pytest.mark.parametrize(
    ("kind", "motor", "place"),
    [(QUAD_X, 2, "rear left"), (QUAD_PLUS, 3, "front"), (HEXA_X, 5, "front right"), (OCTA_PLUS, 7, "left"),
     (Y6, 1, "front right")],
)  # fmt: skip
def test_a_motor_that_stops_is_named_on_any_frame(kind: tuple[int, int], motor: int, place: str) -> None:
    """By its command before the upset, and everything that follows is its consequence."""
    fall, name = cut(kind, motor), f"motor {motor} ({place}) gave too little thrust"
    (by_px4,) = under_px4(fall, settings(geometry(frame(*kind))), pwm=False)
    (by_ardupilot,) = under_ardupilot(fall, kind)
    assert (by_px4.title, by_ardupilot.title) == (name, name)
    for one in (by_px4, by_ardupilot):
        assert one.severity == "critical"
        assert one.onset_s == pytest.approx(FAILS_S + 0.6, abs=0.6)
        assert {"attitude", "crash"} <= {below.kind for below in one.consequences}


@pytest.mark.parametrize(("every", "pwm"), [(1, True), (10, False), (20, True)])
def test_outputs_of_any_rate_and_unit_name_it(every: int, pwm: bool) -> None:
    parameters = settings({"MAV_TYPE": 2.0, "SYS_AUTOSTART": 4001.0})
    (finding,) = under_px4(cut(QUAD_X, 3), parameters, every=every, pwm=pwm)
    assert finding.title == "motor 3 (front left) gave too little thrust"


def test_a_frame_that_nobody_tells_has_numbers_and_no_places() -> None:
    (finding,) = under_px4(cut(QUAD_X, 3), settings({"MAV_TYPE": 2.0, "SYS_AUTOSTART": 3010.0}))
    assert finding.title == "motor 3 gave too little thrust"


def test_a_motor_that_still_gives_a_part_lets_it_fly_on_and_is_a_warning() -> None:
    (finding,) = under_px4(cut(HEXA_X, 1, 0.3), settings(geometry(frame(*HEXA_X))), pwm=False)
    assert (finding.title, finding.severity) == ("motor 1 (right) lost thrust", "warning")
    assert finding.onset_s == pytest.approx(FAILS_S, abs=3.0)


def still(t: float) -> Floats:
    return np.zeros(3)


def pushed(*torque: float, for_s: float) -> Callable[[float], Floats]:
    return lambda t: np.array(torque) if FAILS_S <= t < FAILS_S + for_s else np.zeros(3)


def all_weak(t: float, given: Floats) -> Floats:
    return given * (0.4 if t >= FAILS_S else 1.0)


def sound(t: float, given: Floats) -> Floats:
    return given


@pytest.mark.parametrize(
    ("event", "kick", "mode"),
    [
        pytest.param(sound, still, 2.0, id="a healthy flight"),
        pytest.param(sound, pushed(0, 0, 8, for_s=8), 2.0, id="a yaw that takes all that a pair has"),
        pytest.param(sound, pushed(200, -200, 0, for_s=0.1), 2.0, id="a blow that it recovers from"),
        pytest.param(all_weak, still, 2.0, id="all motors at their limit alike"),
        pytest.param(efficiency(1, 0.0), still, 10.0, id="acro, in which every attitude is meant"),
        pytest.param(efficiency(1, 0.0, at=ARMED_S + 0.2), still, 2.0, id="a tip-over on the ground"),
    ],
)
def test_what_is_no_lost_motor_names_none(event: Callable[[float, Floats], Floats],
                                          kick: Callable[[float], Floats], mode: float) -> None:  # fmt: skip
    fall = fly(frame(*QUAD_X), event, kick)
    found = [
        *under_px4(fall, settings({"MAV_TYPE": 2.0, "SYS_AUTOSTART": 4001.0}), mode),
        *under_ardupilot(fall, QUAD_X, mode=1.0 if mode == 10.0 else 5.0),
    ]
    assert not [one.title for one in every_finding(found) if one.title.endswith("gave too little thrust")]


def test_motors_told_to_stop_in_the_air_are_all_named() -> None:
    fall = cut(QUAD_X, 1)
    stopped = fall._replace(asked=np.where(fall.t > FAILS_S - 0.5, 0.0, fall.asked))
    (finding,) = under_px4(stopped, settings({"MAV_TYPE": 2.0}))
    assert (finding.title, finding.suspect) == ("all motors were told to stop in the air", "operation")


def test_a_fall_into_the_ground_is_a_crash_in_any_mode() -> None:
    fall = fly(frame(*QUAD_X), all_weak)
    for mode in (1.0, 5.0):
        (finding,) = under_ardupilot(fall, QUAD_X, mode=mode)
        assert (finding.kind, finding.severity) == ("crash", "critical")
        assert finding.title.startswith("it hit the ground at ")
    (finding,) = under_px4(fall, settings({"MAV_TYPE": 2.0}), mode=10.0)
    assert finding.onset_s == pytest.approx(fall.down_s, abs=0.1)


def test_a_landing_is_no_crash() -> None:
    fall = fly(frame(*QUAD_X), sound)
    assert not under_ardupilot(fall, QUAD_X)
    assert not under_px4(fall, settings({"MAV_TYPE": 2.0}))


SERVO = Setting("SERVO1_FUNCTION", 1.0, "PARM", changed_at_s=FAILS_S - 0.3)


def test_a_parameter_changed_before_an_upset_leads_with_its_values_and_the_way_back() -> None:
    (finding,) = under_ardupilot(cut(QUAD_X, 1), QUAD_X, SERVO)
    assert finding.title == "SERVO1_FUNCTION was changed in flight, which switched motor 1 (front right) off"
    assert finding.parameters == ("SERVO1_FUNCTION",)
    assert "from 33 to 1" in finding.evidence
    assert "'param set SERVO1_FUNCTION 33'" in finding.evidence
    assert {"attitude", "crash"} <= {one.kind for one in finding.consequences}


def test_under_px4_it_leads_too() -> None:
    changed = Setting("PWM_MAIN_FUNC1", 0.0, "the log", changed_at_s=FAILS_S - 0.3)
    parameters = settings({"MAV_TYPE": 2.0, **{f"PWM_MAIN_FUNC{n}": 100.0 + n for n in range(1, 5)}}, changed)
    first, *_ = under_px4(cut(QUAD_X, 1), parameters)
    assert first.title == "PWM_MAIN_FUNC1 was changed in flight, which switched motor 1 off"


@pytest.mark.parametrize(
    "changed",
    [
        pytest.param([
                      Setting("ATC_RAT_RLL_P", 0.2, "PARM", changed_at_s=FAILS_S - 14)], id="long before"),
        pytest.param([Setting("ATC_RAT_RLL_P", 0.2, "PARM", changed_at_s=FAILS_S + 1.5)], id="after the upset"),
        pytest.param([Setting("LOG_BITMASK", 1.0, "PARM", changed_at_s=FAILS_S - 1)], id="a parameter of the log"),
        pytest.param([Setting("SIM_ENGINE_FAIL", 1.0, "PARM", changed_at_s=FAILS_S - 1)], id="one of the simulator"),
        pytest.param([Setting("ATC_RAT_RLL_P", 0.2, "PARM", changed_at_s=FAILS_S - 2),
                      Setting("ATC_RAT_RLL_P", 0.1, "PARM", changed_at_s=FAILS_S - 1)], id="one put back"),
    ],
)  # fmt: skip
def test_a_change_that_did_not_come_before_the_upset_is_not_blamed(changed: list[Setting]) -> None:
    before = {one.name: (Setting(one.name, 0.1, "PARM"),) for one in changed}
    parameters = {**frame_settings(QUAD_X), **before}
    for one in changed:
        parameters[one.name] = (*parameters[one.name], one)
    first, *_ = find(Flight(dataflash_log(cut(QUAD_X, 1), frame(*QUAD_X), parameters)))
    assert first.title == "motor 1 (front right) gave too little thrust"


def test_a_change_with_no_upset_after_it_is_only_noted() -> None:
    changed = Setting("ATC_RAT_RLL_P", 0.2, "PARM", changed_at_s=FAILS_S)
    parameters = {**frame_settings(QUAD_X), "ATC_RAT_RLL_P": (Setting("ATC_RAT_RLL_P", 0.1, "PARM"), changed)}
    found = find(Flight(dataflash_log(fly(frame(*QUAD_X), sound), frame(*QUAD_X), parameters)))
    assert [(one.title, one.severity) for one in found] == [("parameters were changed in the air", "info")]


@pytest.mark.parametrize("name", ["SIM ", ""])  # without it before firmware 4.1
@pytest.mark.parametrize(("speed", "kinds"), [(8.9, ["crash"]), (0.6, [])])
def test_what_the_simulator_says_of_the_ground_counts_by_its_speed(name: str, speed: float, kinds: list[str]) -> None:
    fall = fly(frame(*QUAD_X), sound)
    said = [(FAILS_S, f"{name}Hit ground at {speed} m/s")]
    found = find(Flight(dataflash_log(fall, frame(*QUAD_X), frame_settings(QUAD_X), messages=said)))
    assert [one.kind for one in found] == kinds

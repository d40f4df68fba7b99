"""What sound parts do and operators mean is no finding: each of these was once taken for a part that failed."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.ecosystems.ardupilot.examining import find
from care_core.ecosystems.ardupilot.measures.outcome import plain_checks
from care_core.ecosystems.findings import NO_BATTERY, UNDRIVEN, every_finding
from care_core.ecosystems.measures import Mission
from care_core.run import Setting
from tests.flights import DOWN_S, END_S, UP_S, Made, flight_of

HEIGHTS = (("CTUN", "Alt"), ("CTUN", "BAlt"), ("BARO", "Alt"), ("BARO#2", "Alt"), ("POS", "RelHomeAlt"), ("GPS", "Alt"))


def titles(made: Made) -> list[str]:
    return [one.title for one in every_finding(made.find())]


def dive_in(*modes: tuple[float, float]) -> Made:
    dive = Made()
    dive.facts = {"firmware": "ArduSub V4.5.0"}
    dive.rows["MODE"] = [(at, {"ModeNum": number}) for at, number in modes]
    dive.table["ATT"]["DesYaw"][:] = 90.0
    dive.table["RATE"] = {"ROut": dive.noise(0.02), "YOut": dive.noise(0.02)}
    return dive


def test_a_stick_that_steers_a_submarine_by_hand_shows_no_weak_thruster() -> None:
    dive = dive_in((0.0, 19.0))
    dive.table["RATE"]["YOut"][dive.after(40.0, 60.0)] = 0.3
    assert not [title for title in titles(dive) if "thruster" in title]


def test_what_lay_on_its_back_before_a_parameter_was_changed_was_not_upset_by_it() -> None:
    dive = dive_in((0.0, 19.0), (50.0, 4.0))
    dive.table["ATT"]["Roll"][:] = 170.0
    dive.table["RATE"]["ROut"][:] = 1.0
    flight = dive.flight()
    for name, before in (("WPNAV_ACCEL", 0.0), ("PILOT_SPEED", 50.0)):
        changed = (Setting(name, before, "PARM"), Setting(name, 100.0, "PARM", changed_at_s=50.0))
        found = find(flight_of(dive.tables(), {**flight.settings, name: changed}, dive.facts, END_S))
        said = [one.title for one in every_finding(found)]
        assert "the vehicle is upside down" in said
        assert not [title for title in said if "changed in flight" in title or "thruster" in title]


@pytest.mark.parametrize(("before", "is_blamed"), [(0.0, False), (50.0, True)])
def test_what_the_firmware_puts_right_as_a_mode_begins_upset_nothing(before: float, is_blamed: bool) -> None:
    made = Made()
    made.table["ATT"]["Roll"][made.after(52.0)] += 90.0
    changed = (Setting("WPNAV_ACCEL", before, "PARM"), Setting("WPNAV_ACCEL", 100.0, "PARM", changed_at_s=50.0))
    found = find(flight_of(made.tables(), {**made.known, "WPNAV_ACCEL": changed}, made.facts, END_S))
    assert any(one.title.startswith("WPNAV_ACCEL was changed") for one in every_finding(found)) == is_blamed


def test_a_failsafe_of_a_monitor_that_gains_in_the_air_is_of_no_battery() -> None:
    made = Made()
    del made.settings["MOT_BAT_VOLT_MAX"]
    made.settings["BATT_LOW_VOLT"] = 10.5
    made.rows["ERR"] = [(40.0, {"Subsys": 6.0, "ECode": 1.0})]
    made.table["BAT"]["Volt"] = np.interp(made.t, [0.0, END_S], [5.95, 6.1])
    finding = made.find()[0]
    assert (finding.title, finding.parameters) == (f"{NO_BATTERY}, and its failsafe acted", ())
    assert "no pack gains by flying" in finding.evidence


def test_a_blow_that_two_accelerometers_feel_at_other_moments_sets_them_not_apart() -> None:
    made = Made()
    made.table["IMU"]["AccZ"][np.argmin(np.abs(made.t - 60.0))] = -800.0
    assert "the accelerometers disagree" not in titles(made)
    made.table["IMU"]["AccX"] += 8.0
    assert "the accelerometers disagree" in titles(made)


def climbing() -> Made:
    """With all the throttle from 20 s on, at 3 m/s, the mixer taking from all motors but one."""
    made = Made()
    up = made.after(20.0, DOWN_S)
    made.table["CTUN"]["ThO"][up] = 1.0
    for name, field in HEIGHTS:
        made.table[name][field][up] += 3.0 * (made.t[up] - 20.0)
    for n in range(1, 5):
        made.table["RCOU"][f"C{n}"][up] = 1950.0 if n == 4 else 1740.0
    return made


def test_a_climb_with_all_the_throttle_is_no_hover_and_shows_no_weak_motor() -> None:
    assert not [title for title in titles(climbing()) if "hovering takes" in title or "motor 4" in title]
    hover = climbing()
    for name, field in HEIGHTS:
        hover.table[name][field][:] = Made().table[name][field]
    assert any("motor 4" in title for title in titles(hover))


@pytest.mark.parametrize(("height_m", "what"), [(0.0, "the ground"), (4.0, "something")])
def test_what_is_stopped_dead_above_the_ground_hit_something(height_m: float, what: str) -> None:
    made = Made()
    hit = made.t >= 50.0
    made.table["IMU"]["AccX"][np.argmax(hit)] = -150.0
    made.table["GPS"]["Spd"] = np.where(hit, 0.0, 6.0)
    for name, field in HEIGHTS:
        made.table[name][field][made.t > 40.0] = height_m
    found = made.flight().hit
    assert found is not None
    assert found.what == what


@pytest.mark.parametrize(("falls_s", "is_steered"), [(60.2, True), (58.0, False)])
def test_a_mode_that_minds_a_stick_at_its_bottom_brings_a_copter_down(falls_s: float, is_steered: bool) -> None:
    made = Made(rate_hz=50.0)
    made.rows["MODE"] = [(0.0, {"ModeNum": 4.0}), (60.0, {"ModeNum": 0.0})]
    made.table["RCIN"] = {"C3": np.full(len(made.t), 1000.0)}
    lands_s = falls_s + 1.5
    for name, field in HEIGHTS:
        made.table[name][field][:] = np.interp(made.t, [UP_S, 14.0, falls_s, lands_s], [0.0, 10.0, 10.0, 0.0])
    made.rows["ERR"] = [(max(lands_s, 61.0), {"Subsys": 12.0, "ECode": 1.0})]
    said = [one.title for one in every_finding(made.find()) if one.kind == "crash"]
    assert ("it was steered into the ground" in said) == is_steered


def on_a_bench() -> Made:
    """Motors at 40% and more for a minute and a half, one far above the others, and nothing moves."""
    made = Made()
    for name, field in HEIGHTS:
        made.table[name][field][:] = made.noise(0.1)
    for field in ("Roll", "Pitch", "DesRoll", "DesPitch"):
        made.table["ATT"][field][:] = made.noise(0.05)
    made.table["RCOU"]["C2"][made.after(UP_S, DOWN_S)] += 300.0
    return made


def test_motors_of_what_does_not_stir_are_not_compared() -> None:
    bench = on_a_bench()
    said = titles(bench)
    assert "its motors were driven, and it did not stir" in said
    assert not [title for title in said if "motor 2" in title]
    bench.table["ATT"]["Roll"] += np.where(bench.after(20.0, 22.0), 8.0, 0.0)
    assert "its motors were driven, and it did not stir" not in titles(bench)


def test_what_flies_stirs() -> None:
    assert "its motors were driven, and it did not stir" not in titles(Made())


def test_what_nobody_asked_to_arm_was_not_refused() -> None:
    made = Made()
    del made.rows["ARM"]
    made.table["CTUN"]["ThO"][:] = 0.0
    for name, field in HEIGHTS:
        made.table[name][field][:] = 0.0
    made.rows["MSG"] = [(20.0, {"Message": "PreArm: RC not found"})]
    assert "arming would be refused: RC not found" in titles(made)
    made.rows["MSG"] = [(20.0, {"Message": "Arm: RC not found"})]
    assert "arming was refused: RC not found" in titles(made)


@pytest.mark.parametrize(("throttle", "is_told"), [(0.0, False), (0.4, True)])
def test_a_rover_that_never_drove_loses_no_fix_on_its_way(throttle: float, is_told: bool) -> None:
    made = Made()
    made.facts = {"firmware": "ArduRover V4.5.4"}
    made.rows["MODE"] = [(0.0, {"ModeNum": 0.0})]
    made.table["CTUN"]["ThO"][:] = throttle
    made.table["GPS"]["Status"][made.after(40.0, 60.0)] = 2.0
    made.table["GPS"]["Spd"][:] = 0.3
    assert ("the GPS fix was lost on the way" in titles(made)) == is_told


@pytest.mark.parametrize(("firmware", "value"), [("ArduSub V4.5.6", 1.0), ("ArduRover V4.5.4", 1.0)])
def test_a_disarming_by_force_harms_nothing_that_cannot_fall(firmware: str, value: float) -> None:
    made = Made()
    made.facts = {"firmware": firmware}
    made.rows["MODE"] = [(0.0, {"ModeNum": 0.0})]
    made.rows["ARM"][-1][1]["Forced"] = 1.0
    mission = Mission(made.flight(), made.tables(), 5.0, DOWN_S + 5.0, True, {})
    assert {one.name: one.value for one in plain_checks(mission)}["disarmed"] == value


@pytest.mark.parametrize(("lean", "is_told"), [(60.0, False), (10.0, True)])
def test_what_lies_on_an_arm_is_shaken_by_the_ground(lean: float, is_told: bool) -> None:
    made = Made()
    late = made.after(DOWN_S - 1.0, DOWN_S + 4.0)
    made.table["ATT"]["Roll"][late] = lean
    made.table["ATT"]["DesRoll"][late] = lean
    made.table["VIBE"]["VibeX"][late] = 45.0
    assert any("vibration" in title for title in titles(made)) == is_told


@pytest.mark.parametrize(("speed", "is_told"), [(30.0, False), (8.0, True)])
def test_the_outputs_of_what_flies_very_fast_show_no_weak_motor(speed: float, is_told: bool) -> None:
    made = Made()
    made.table["RCOU"]["C2"][made.after(50.0, DOWN_S)] += 300.0
    made.table["GPS"]["Spd"][made.after(49.0, DOWN_S)] = speed
    assert any("motor 2" in title for title in titles(made)) == is_told


@pytest.mark.parametrize(("has_fix", "is_told"), [(False, False), (True, True)])
def test_a_receiver_that_starts_while_it_is_armed_has_not_lost_its_satellites(has_fix: bool, is_told: bool) -> None:
    made = Made()
    starts = made.after(0.0, UP_S + 20.0)
    made.table["GPS"]["NSats"][starts] = 4.0
    made.table["GPS"]["Status"][starts & (made.t < UP_S - 1.0 if has_fix else starts)] = 1.0
    assert any("satellites" in title for title in titles(made)) == is_told


@pytest.mark.parametrize(("throttle", "is_undriven"), [(0.0, True), (0.5, False)])
def test_a_crash_that_the_firmware_finds_before_any_throttle_was_steered_by_nobody(
    throttle: float, is_undriven: bool
) -> None:
    made = Made()
    made.rows["MODE"] = [(0.0, {"ModeNum": 0.0})]
    made.table["RCIN"] = {"C3": np.full(len(made.t), 1000.0)}
    made.table["CTUN"]["ThO"][:] = throttle
    for name, field in HEIGHTS:
        made.table[name][field][:] = 0.0
    made.rows["ERR"] = [(60.0, {"Subsys": 12.0, "ECode": 1.0})]
    said = [one.title for one in every_finding(made.find()) if one.kind == "crash"]
    assert (UNDRIVEN in said) == is_undriven


def test_records_that_the_receivers_own_clock_puts_before_others_are_no_jumps() -> None:
    made = Made()
    gps = made.table["GPS"]
    gps["GMS"] = 1e8 + 1e3 * made.t
    mixed = made.after(50.0, 50.25)
    gps["Lat"][mixed] += 60.0 / 111319.5
    assert [title for title in titles(made) if "jumps" in title], "in order, they are"
    gps["GMS"][mixed] -= 5e3
    assert not [title for title in titles(made) if "jumps" in title]


@pytest.mark.parametrize(("falls", "is_caught"), [(False, True), (True, False)])
def test_what_turns_over_and_does_not_fall_lies_on_what_it_hit(falls: bool, is_caught: bool) -> None:
    made = Made()
    lost = made.after(50.0)
    grow = np.clip((made.t - 50.0) / 0.5, 0.0, 1.0)[lost]
    made.table["ATT"]["Roll"][lost], made.table["ATT"]["Pitch"][lost] = -85.0 * grow, 40.0 * grow
    made.table["RCOU"]["C2"][made.after(50.0, 52.0)] = 1950.0
    made.table["RCOU"]["C1"][made.after(50.0, 52.0)] = 1100.0
    made.table["GPS"]["Spd"][lost] *= falls
    if falls:
        for name, field in HEIGHTS:
            made.table[name][field][lost] = np.clip(12.0 - 5.0 * (made.t[lost] - 50.0) ** 2, 0.0, None)
    made.rows["ERR"] = [(54.0, {"Subsys": 12.0, "ECode": 1.0})]
    made.rows["ARM"][1] = (54.0, {"ArmState": 0.0, "Forced": 0.0})
    said = titles(made)
    assert ("it hit something" in said) == is_caught
    assert ("motor 2 (rear left) gave too little thrust" in said) == falls


@pytest.mark.parametrize(("swung", "is_named"), [(0.0, True), (25.0, False)])
def test_what_leaned_as_far_to_the_other_side_just_before_lost_no_motor(swung: float, is_named: bool) -> None:
    made = Made()
    lost = made.after(50.0)
    grow = np.clip((made.t - 50.0) / 0.5, 0.0, 1.0)[lost]
    made.table["ATT"]["Roll"][made.after(49.0, 49.6)] = swung
    made.table["ATT"]["Roll"][lost], made.table["ATT"]["Pitch"][lost] = -60.0 * grow, 40.0 * grow
    made.table["RCOU"]["C2"][made.after(50.0, 52.0)] = 1950.0
    made.table["RCOU"]["C1"][made.after(50.0, 52.0)] = 1100.0
    for name, field in HEIGHTS:
        made.table[name][field][lost] = np.clip(12.0 - 5.0 * (made.t[lost] - 50.0) ** 2, 0.0, None)
    made.rows["ERR"] = [(54.0, {"Subsys": 12.0, "ECode": 1.0})]
    assert any("gave too little thrust" in title for title in titles(made)) == is_named


@pytest.mark.parametrize(
    ("start_s", "follows", "says"),
    [(16.0, True, "it had held or turned as told until then"), (16.0, False, "turning direction"),
     (40.0, False, "it had held or turned as told until then")],
)  # fmt: skip
def test_what_held_or_turned_as_told_has_no_motor_that_turns_the_wrong_way(
    start_s: float, follows: bool, says: str
) -> None:
    made = Made()
    zero = np.zeros_like(made.t)
    wanted = np.where(made.after(11.0, 14.0), 60.0, 0.0)
    spins = made.after(start_s, start_s + 20.0)
    turns = np.where(spins, 30.0 + 3.0 * (made.t - start_s), wanted if follows else 0.0)
    pushes = np.where(spins, -0.5, 0.0)
    made.table["RATE"] = {"R": zero, "P": zero, "RDes": zero, "PDes": zero, "ROut": zero, "POut": zero,
                          "Y": turns, "YDes": wanted, "YOut": pushes}  # fmt: skip
    (spin,) = [one for one in every_finding(made.find()) if one.title == "it spins against its control"]
    assert says in spin.evidence


@pytest.mark.parametrize(("sinks_ms", "noise_m", "landed"), [(0.0, 0.05, 1.0), (5.0, 0.05, 0.0), (0.0, 0.0, 0.0)])
def test_what_keeps_its_height_once_its_motors_stop_stands_on_higher_ground(
    sinks_ms: float, noise_m: float, landed: float
) -> None:
    made = Made()
    off_s = DOWN_S + 5.0
    height = np.clip(3.0 - sinks_ms * np.clip(made.t - off_s, 0.0, None), 0.0, None) + made.noise(noise_m)
    for name, field in HEIGHTS:
        made.table[name][field][made.after(60.0)] = height[made.after(60.0)]
    made.table["CTUN"]["ThO"][made.after(60.0, off_s)] = 0.3
    mission = Mission(made.flight(), made.tables(), 5.0, off_s, True, {})
    assert {one.name: one.value for one in plain_checks(mission)}["landed"] == landed


@pytest.mark.parametrize(("by_barometer_m", "landed"), [(0.2, 1.0), (4.0, 0.0)])
def test_an_estimate_that_ran_away_lifts_nothing_off_the_ground(by_barometer_m: float, landed: float) -> None:
    made = Made()
    off_s = DOWN_S + 5.0
    at_end = made.after(60.0)
    falls = np.clip(4.0 - 5.0 * np.clip(made.t - off_s, 0.0, None), 0.0, None) + made.noise(0.05)
    for name, field in HEIGHTS:
        made.table[name][field][at_end] = falls[at_end]
    for name, field in (("CTUN", "BAlt"), ("BARO", "Alt"), ("BARO#2", "Alt")):
        if name in made.table:
            made.table[name][field][at_end] = by_barometer_m + made.noise(0.05)[at_end]
    made.table["CTUN"]["ThO"][made.after(60.0, off_s)] = 0.3
    mission = Mission(made.flight(), made.tables(), 5.0, off_s, True, {})
    assert {one.name: one.value for one in plain_checks(mission)}["landed"] == landed


def test_a_pack_that_is_not_full_darkens_no_board() -> None:
    made = Made()
    made.table["BAT"]["Volt"] -= 1.1
    made.table["POWR"]["Vcc"][made.after(20.0)] = 4.2
    (pack,) = [one for one in made.find() if one.title == "the battery was only partly charged"]
    assert not [one for one in pack.below if one.title.startswith("the autopilot's own supply")]
    assert any(title.startswith("the autopilot's own supply") for title in titles(made))


def test_a_barometer_alone_tells_the_height_of_a_flight() -> None:
    made = Made()
    for name in ("POS", "CTUN"):
        del made.table[name]
    known = made.flight().height
    assert known is not None
    assert float(known[1].max()) == pytest.approx(12.0, abs=0.5)

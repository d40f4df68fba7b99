"""A motor that stopped or is weak, and what is none."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.ecosystems.ardupilot.examining import find
from care_core.ecosystems.findings import every_finding
from care_core.logs.base import Table
from tests.flights import DOWN_S, END_S, FAILS_S, HEIGHT_M, RATES, UP_S, Made, falling, first, flight_of


@pytest.mark.parametrize("rate_hz", RATES)
def test_a_weak_motor_is_named(rate_hz: float) -> None:
    made = Made(rate_hz)
    made.table["RCOU"]["C3"][made.after(FAILS_S, DOWN_S)] += 250
    finding = first(made)
    assert (finding.kind, finding.title) == ("motor", "motor 3 (front left) lost thrust")
    assert finding.onset_s == pytest.approx(FAILS_S, abs=2.0 + 1 / rate_hz)
    assert finding.probability > 0.8


@pytest.mark.parametrize(("speed_ms", "rests"), [(0.3, False), (0.05, True)])  # a gale moves it
def test_motors_that_push_against_an_obstacle_tell_nothing_of_themselves(speed_ms: float, rests: bool) -> None:
    made = Made()
    leaning = made.after(FAILS_S, DOWN_S)
    made.table["ATT"]["Roll"][leaning] = made.table["ATT"]["DesRoll"][leaning] = 25.0
    made.table["GPS"]["Spd"][leaning] = speed_ms
    made.table["RCOU"]["C1"][leaning] += 300.0
    assert ("blocked" in [one.kind for one in made.find()]) == rests
    made.table["VIBE"]["Clip"][made.after(FAILS_S)] = 3.0
    finding = first(made)
    assert (finding.kind, finding.title) == ("blocked", "something holds it: it leans and does not move")
    assert "motor" not in [one.kind for one in (finding, *finding.consequences)]


@pytest.mark.parametrize(("from_deg", "speed_ms", "is_held"), [(0.0, 0.1, True), (0.0, 0.5, False), (12.0, 0.1, False)])
def test_a_lean_that_grows_while_it_stands_is_what_holds_it(from_deg: float, speed_ms: float, is_held: bool) -> None:
    """A steady wind is leant against from the start, and a gust moves what leans against it."""
    made = Made()
    lean = np.interp(made.t, [FAILS_S, FAILS_S + 3.0, FAILS_S + 6.0], [from_deg, 16.0, 16.0])
    lean[made.after(FAILS_S + 6.0)] = from_deg
    lean[~made.after(UP_S + 1, DOWN_S - 1)] = 0.0
    made.table["ATT"]["Roll"] = made.table["ATT"]["DesRoll"] = lean
    made.table["GPS"]["Spd"] = np.full(len(made.t), speed_ms)
    assert ("blocked" in [one.kind for one in made.find()]) == is_held


@pytest.mark.parametrize(("climbs_ms", "is_held"), [(0.0, True), (2.0, False)])
def test_what_climbs_as_it_leans_is_held_by_nothing(climbs_ms: float, is_held: bool) -> None:
    """A copter that leans into a wind that has just begun, above one place, on its way up."""
    made = Made()
    leaning = made.after(FAILS_S, DOWN_S - 12.0)
    made.table["ATT"]["Roll"][leaning] = made.table["ATT"]["DesRoll"][leaning] = 25.0
    made.table["GPS"]["Spd"][leaning] = 0.05
    for name, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt"), ("CTUN", "BAlt"), ("BARO", "Alt"), ("BARO#2", "Alt")):
        made.table[name][field][leaning] += climbs_ms * (made.t[leaning] - FAILS_S)
    assert ("blocked" in [one.kind for one in made.find()]) == is_held


@pytest.mark.parametrize(("frame", "is_motor"), [("QUAD", False), ("OCTA", True), ("", True)])
def test_a_quad_of_old_firmware_has_no_fifth_motor(frame: str, is_motor: bool) -> None:
    """No parameter tells its frame, and the outputs behind the motors turn a camera."""
    made = Made()
    made.settings = {name: value for name, value in made.settings.items() if name.startswith("MOT_")}
    made.facts = {"firmware": "ArduCopter V3.3", "vehicle": "multicopter", "frame": frame}
    outputs = made.table["RCOU"]
    outputs["C5"] = np.where(made.after(FAILS_S), 2000.0, outputs["C1"])
    outputs["C6"] = outputs["C1"].copy()
    assert any("motor 5" in one.title for one in every_finding(made.find())) is is_motor


def test_an_uneven_load_moves_motors_in_pairs_and_is_no_lost_motor() -> None:
    made = Made()
    for output in ("C1", "C3"):
        made.table["RCOU"][output][made.after(UP_S, DOWN_S)] += 120
    assert made.find() == ()


@pytest.mark.parametrize(("since_s", "kinds"), [(UP_S, []), (FAILS_S, ["motor"])])
def test_the_load_of_a_tricopter_may_lie_on_one_motor_from_the_start(since_s: float, kinds: list[str]) -> None:
    made = Made()
    made.settings |= {
        "FRAME_CLASS": 7,
        "FRAME_TYPE": 0,
        "SERVO3_FUNCTION": 0,
        "SERVO4_FUNCTION": 36,
        "SERVO7_FUNCTION": 39,
    }
    made.table["RCOU"]["C4"][made.after(since_s, DOWN_S)] += 250.0
    assert [one.kind for one in made.find() if one.kind == "motor"] == kinds


def test_a_motor_that_is_up_now_and_then_is_not_weak() -> None:
    made = Made()
    for start in range(30, 90, 12):
        made.table["RCOU"]["C2"][made.after(start, start + 5)] += 300
    assert not [one for one in made.find() if one.kind == "motor"]


def test_a_motor_that_stops_leads_the_crash_it_makes() -> None:
    made = Made()
    falling(made, -60.0, 40.0)  # to the rear left, where motor 2 is
    lost = made.after(FAILS_S, FAILS_S + 2)
    made.table["RCOU"]["C2"][lost] = 1950
    made.table["RCOU"]["C1"][lost] = 1100
    finding = first(made)
    assert finding.title == "motor 2 (rear left) gave too little thrust"
    assert finding.onset_s == pytest.approx(FAILS_S, abs=1.0)
    assert {"attitude", "crash"} <= {one.kind for one in finding.consequences}


def test_a_stopped_controller_is_told_by_its_speed() -> None:
    made = Made()
    t = made.t
    rpm = np.where(np.repeat(t, 4) > UP_S, 5000.0, 0.0)
    rpm[(np.repeat(t, 4) > FAILS_S) & (np.tile(np.arange(4), len(t)) == 3)] = 0.0
    tables = {**made.tables(), "ESC": Table(np.repeat(t, 4), {"Instance": np.tile(np.arange(4.0), len(t)), "RPM": rpm})}
    flight = made.flight()
    finding = find(flight_of(tables, flight.settings, flight.log.facts, END_S))[0]
    assert finding.title == "motor 4 (rear right) stopped"


@pytest.mark.parametrize(("asked", "stopped"), [(0.5, True), (0.02, False)])
def test_a_motor_that_turns_slowly_as_it_is_told_has_not_stopped(asked: float, stopped: bool) -> None:
    made = Made()
    slow = made.after(FAILS_S, FAILS_S + 3)
    made.table["RCOU"]["C1"][slow] = 1000 + 1000 * asked
    for number in range(4):
        rpm = np.where(made.after(UP_S, DOWN_S), 4000.0, 0.0)
        made.table[f"ESC{number}"] = {"Instance": np.full(len(made.t), float(number)), "RPM": rpm}
    made.table["ESC0"]["RPM"][slow] = 300.0
    tables = made.tables()
    parts = [tables.pop(f"ESC{number}") for number in range(4)]
    t = np.concatenate([one.t for one in parts])
    order = np.argsort(t, kind="stable")
    tables["ESC"] = Table(t[order], {f: np.concatenate([one[f] for one in parts])[order] for f in ("Instance", "RPM")})
    found = find(flight_of(tables, made.known, made.facts))
    assert any(one.title == "motor 1 (front right) stopped" for one in found) is stopped


def test_a_fall_that_lasts_a_second_is_a_loss_of_control_and_names_the_motor_in_a_slow_log() -> None:
    made = Made(rate_hz=2.5)
    fall, after = made.after(FAILS_S, FAILS_S + 1.0), made.after(FAILS_S + 1.0)
    made.table["ATT"]["Roll"][fall], made.table["ATT"]["Pitch"][fall] = -70.0, 40.0  # to the rear left
    made.table["RCOU"]["C2"][fall], made.table["RCOU"]["C1"][fall] = 1950, 1100
    for name, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt")):
        made.table[name][field][fall] = np.linspace(HEIGHT_M, 1.5, int(fall.sum()))
        made.table[name][field][after] = 0.0
    for field in ("Roll", "Pitch", "DesRoll", "DesPitch"):
        made.table["ATT"][field][after] = 0.0
    assert made.flight().lost_control_s == pytest.approx(FAILS_S, abs=0.5)
    assert first(made).title == "motor 2 (rear left) gave too little thrust"


@pytest.mark.parametrize(("mates", "kinds"), [((2,), ["motor"]), ((1, 2), [])])
def test_two_motors_that_are_asked_for_alike_turn_the_vehicle_and_are_not_weak(
    mates: tuple[int, ...], kinds: list[str]
) -> None:
    made = Made()
    for n in mates:  # 1 and 2 turn the same way
        made.table["RCOU"][f"C{n}"][made.after(50.0, 56.0)] += 250
    made.rows["MSG"].append((53.0, {"Message": "Potential Thrust Loss (2)"}))
    assert [one.kind for one in made.find() if one.kind == "motor"] == kinds


@pytest.mark.parametrize(("output", "named"), [("ROut", "roll"), ("YOut", "heading")])
def test_a_submarine_that_fights_to_hold_still_lacks_a_thruster(output: str, named: str) -> None:
    dive = Made()
    dive.facts = {"firmware": "ArduSub V4.5.0"}
    dive.rows["MODE"] = [(0.0, {"ModeNum": 2.0})]
    dive.table["RATE"] = {"ROut": dive.noise(0.02), "YOut": dive.noise(0.02)}
    dive.table["ATT"]["DesYaw"][:] = 90.0
    assert not [one for one in every_finding(dive.find()) if "thruster" in one.title]
    dive.table["RATE"][output][dive.after(40.0, 80.0)] = 0.5
    (found,) = [one for one in every_finding(dive.find()) if "thruster" in one.title]
    assert found.title == f"a thruster is weak, off or reversed: it fights to hold its {named}"
    assert found.kind == "motor"


@pytest.mark.parametrize(("frame", "named"), [(1.0, ()), (2.0, ()), (6.0, ("FRAME_CONFIG",))])
def test_a_submarine_of_a_rare_frame_that_fights_may_be_of_another(frame: float, named: tuple[str, ...]) -> None:
    dive = Made()
    dive.facts = {"firmware": "ArduSub V4.5.0"}
    dive.rows["MODE"] = [(0.0, {"ModeNum": 2.0})]
    dive.settings["FRAME_CONFIG"], dive.defaults["FRAME_CONFIG"] = frame, 1.0
    dive.table["RATE"] = {"ROut": dive.noise(0.02) + 0.5 * dive.after(40.0, 80.0), "YOut": dive.noise(0.02)}
    dive.table["ATT"]["DesYaw"][:] = 90.0
    (found,) = [one for one in every_finding(dive.find()) if "thruster" in one.title]
    assert found.parameters == named
    assert ("FRAME_CONFIG is" in found.evidence) is (frame != 1.0)


def test_motor_detection_that_fails_is_told_by_its_thruster() -> None:
    dive = Made()
    dive.facts = {"firmware": "ArduSub V4.7.0"}
    dive.rows["MSG"] += [
        (FAILS_S, {"Message": "Bad thrust read, trying to push the other way..."}),
        (FAILS_S + 2, {"Message": "Failed! Please check Thruster 3 and frame setup!"}),
    ]
    (found,) = [one for one in every_finding(dive.find()) if "thruster" in one.title]
    assert (found.title, found.kind, found.severity) == ("motor detection fails at thruster 3", "motor", "warning")
    assert found.onset_s == FAILS_S + 2


def test_what_idles_on_the_ground_has_no_weak_motor() -> None:
    made = Made()
    for table in made.table.values():
        for height in {"Alt", "BAlt", "RelHomeAlt"} & table.keys():
            table[height] = np.full_like(table[height], 20.0)
    made.table["CTUN"]["ThO"][:] = 0.05
    made.table["RCOU"]["C1"] = 1250 + 8 * np.clip(made.t - 20, 0, 40)  # an integrator that winds up
    assert "motor" not in [one.kind for one in made.find()]

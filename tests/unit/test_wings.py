"""What fails on a plane, planted into a sound flight: surfaces, the airspeed sensor, the propeller, a stall."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.ecosystems.ardupilot.checks.wings.airspeed import SENSOR_SILENT
from care_core.ecosystems.findings import Finding, every_finding
from tests.flights import DOWN_S
from tests.planes import CRUISE_MS, HEIGHT_M, MadePlane

RATES_HZ = (10.0, 2.5)


def found(flown: MadePlane, kind: str) -> Finding | None:
    return next((one for one in every_finding(flown.find()) if one.kind == kind), None)


@pytest.mark.parametrize("rate_hz", RATES_HZ)
@pytest.mark.parametrize("seed", range(3))
def test_a_sound_plane_is_silent(rate_hz: float, seed: int) -> None:
    assert MadePlane(rate_hz, seed).find() == ()


@pytest.mark.parametrize(("channel", "column", "by_hand_s", "title"), [
    ("PIDP", "Elev", 45.0, "the elevator turns the plane the wrong way"),
    ("PIDR", "Ail", 45.0, "the ailerons turn the plane the wrong way"),
    ("PIDP", "Elev", 0.0, "the elevator no longer obeys"),
    ("PIDR", "Ail", 0.0, "the ailerons no longer obey"),
])  # fmt: skip
@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_a_surface_that_turns_it_the_wrong_way(
    rate_hz: float, channel: str, column: str, by_hand_s: float, title: str
) -> None:
    flown = MadePlane(rate_hz)
    flown.rows["MODE"] = [(0.0, {"ModeNum": 0.0}), (by_hand_s, {"ModeNum": 10.0})]
    attitude = {"PIDP": "Pitch", "PIDR": "Roll"}[channel]
    now = flown.after(50.0, 53.0)
    flown.table["AETR"][column][now] = 4500.0
    flown.table[channel]["Tar"][now] = 60.0
    flown.table[channel]["Act"][now] = -40.0
    flown.table["ATT"][attitude][now] -= 40.0 * (flown.t[now] - 50.0)
    finding = found(flown, "surface")
    assert finding is not None
    assert finding.title == title
    assert finding.severity == "critical"
    assert 49.0 < finding.onset_s < 52.0


@pytest.mark.parametrize(("mode", "is_used"), [(10.0, True), (0.0, False), (5.0, False), (6.0, True)])
def test_no_barometer_loses_a_plane_that_is_flown_by_hand(mode: float, is_used: bool) -> None:
    flown = MadePlane()
    flown.rows["MODE"] = [(0.0, {"ModeNum": mode})]
    for number in ("", "#2"):
        flown.table[f"BARO{number}"]["Alt"] += np.interp(flown.t, [30.0, 70.0], [0.0, 60.0])
    over = flown.after(80.0)
    flown.table["ATT"]["Roll"][over] = 175.0
    flown.table["ATT"]["DesRoll"][over] = 0.0
    flown.rows["ERR"] = [(82.0, {"Subsys": 12.0, "ECode": 1.0})]
    drifts = found(flown, "barometer")
    assert drifts is not None
    assert drifts.mission_lost is not None
    assert (drifts.mission_lost > 0.05) == is_used


@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_a_gust_is_no_reversed_surface(rate_hz: float) -> None:
    flown = MadePlane(rate_hz)
    now = flown.after(50.0, 50.4)
    flown.table["AETR"]["Ail"][now] = 2000.0
    flown.table["PIDR"]["Act"][now] = -40.0
    flown.table["PIDR"]["Tar"][now] = 20.0
    assert found(flown, "surface") is None


@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_a_surface_at_its_stop_that_does_not_help(rate_hz: float) -> None:
    flown = MadePlane(rate_hz)
    now = flown.after(50.0, 60.0)
    flown.table["AETR"]["Elev"][now] = 4400.0
    flown.table["PIDP"]["Tar"][now] = 12.0
    flown.table["PIDP"]["Act"][now] = 0.0
    finding = found(flown, "surface")
    assert finding is not None
    assert finding.title.startswith("the elevator is at the stop")
    assert finding.probability < 0.5  # a gain may hold it there as well


@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_a_motor_that_draws_less_for_its_throttle(rate_hz: float) -> None:
    flown = MadePlane(rate_hz)
    flown.table["BAT"]["Curr"][flown.after(60.0)] *= 0.4
    finding = found(flown, "motor")
    assert finding is not None
    assert finding.title == "the motor lost thrust"
    assert abs(finding.onset_s - 60.0) < 4.0


@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_a_motor_that_dies_early_in_a_flight_that_glides_on(rate_hz: float) -> None:
    flown = MadePlane(rate_hz)
    dead = flown.after(40.0)
    flown.table["BAT"]["Curr"][dead] = 0.0
    flown.table["CTUN"]["ThO"][dead] = 100.0
    flown.table["GPS"]["Spd"][dead] = 9.0
    finding = found(flown, "motor")
    assert finding is not None
    assert finding.title == "the motor lost thrust"
    assert abs(finding.onset_s - 40.0) < 4.0


def test_a_plane_that_lies_on_the_ground_has_no_frozen_attitude() -> None:
    flown = MadePlane()
    lies = flown.after(DOWN_S + 2.0, float(flown.t[-1]))
    for name in ("Roll", "Pitch", "Yaw"):
        flown.table["ATT"][name] = np.array(flown.table["ATT"].get(name, np.zeros(len(flown.t))))
        flown.table["ATT"][name][lies] = 0.1
    flown.table["GPS"]["Spd"][lies] = 1.3
    assert not [one for one in every_finding(flown.find()) if "frozen" in one.title]


def test_a_throttle_that_is_taken_back_is_no_lost_motor() -> None:
    flown = MadePlane()
    low = flown.after(60.0)
    flown.table["CTUN"]["ThO"][low] *= 0.7
    flown.table["BAT"]["Curr"][low] *= 0.7**2
    assert found(flown, "motor") is None


def runs_along_the_ground(speed_ms: float) -> MadePlane:
    """A take-off run at full throttle from 10 s on that ends at one speed and leads to no flight."""
    flown = MadePlane()
    t, table = flown.t, flown.table
    speed = np.interp(t, [10.0, 20.0], [0.0, speed_ms])
    table["CTUN"] |= {"ThO": np.where(t > 10.0, 100.0, 0.0), "As": speed}
    table["BAT"]["Curr"] = np.where(t > 10.0, 40.0, 0.0)
    table["GPS"] |= {"Spd": speed, "Alt": np.full(len(t), 400.0)}
    table["POS"]["RelHomeAlt"] = np.zeros(len(t))
    table["ATT"] |= {"Roll": np.zeros(len(t)), "DesRoll": np.zeros(len(t)), "Pitch": np.zeros(len(t))}
    for number in ("", "#2"):
        table[f"BARO{number}"]["Alt"] = flown.noise(0.1)
    return flown


def test_full_throttle_that_does_not_bring_it_off_the_ground() -> None:
    finding = found(runs_along_the_ground(4.2), "motor")
    assert finding is not None
    assert finding.title == "it stays on the ground at full throttle"
    assert "lead to 4.2 m/s, where AIRSPEED_MIN is 12" in finding.evidence
    assert finding.onset_s == pytest.approx(10.0, abs=0.3)


def test_a_run_that_is_fast_enough_to_fly_has_a_motor_that_pulls() -> None:
    assert found(runs_along_the_ground(11.0), "motor") is None


@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_an_airspeed_that_stands_still(rate_hz: float) -> None:
    flown = MadePlane(rate_hz)
    flown.table["ARSP"]["Airspeed"][flown.after(55.0)] = 31.0
    told = [one for one in every_finding(flown.find()) if one.kind == "airspeed"]
    assert [one.title for one in told] == ["the airspeed sensor is frozen"]
    assert abs(told[0].onset_s - 55.0) < 2.0


def test_a_sensor_that_the_firmware_gave_up() -> None:
    flown = MadePlane()
    flown.table["ARSP"]["U"][flown.after(70.0)] = 0.0
    finding = found(flown, "airspeed")
    assert finding is not None
    assert "took it out of use at 70 s" in finding.evidence


def test_telemetry_has_the_firmware_s_word_alone_for_a_sensor_that_failed() -> None:
    flown = MadePlane()
    del flown.table["ARSP"]
    said = "Airspeed sensor 1 failure. Disabling"
    flown.rows["MSG"] += [(5.0, {"Message": said})]
    assert found(flown, "airspeed") is None, "it had not taken off"
    flown.rows["MSG"] += [(70.0, {"Message": said}), (80.0, {"Message": said})]
    finding = found(flown, "airspeed")
    assert finding is not None
    assert (finding.title, finding.onset_s, finding.severity) == ("the airspeed sensor failed", 70.0, "warning")
    assert "(2 times)" in finding.evidence


def test_a_sensor_that_is_not_used_fails_nobody() -> None:
    flown = MadePlane()
    flown.settings["ARSPD_USE"] = 0
    flown.table["ARSP"]["U"][flown.after(70.0)] = 0.0
    assert found(flown, "airspeed") is None


def test_a_stall() -> None:
    flown = MadePlane()
    slow = flown.after(60.0, 66.0)
    flown.table["CTUN"]["As"][slow] = 8.0
    sunk = np.interp(flown.t, [60.0, 66.0, 72.0], [0.0, 36.0, 0.0])
    flown.table["POS"]["RelHomeAlt"] -= sunk
    finding = next((one for one in every_finding(flown.find()) if one.title == "the plane stalled"), None)
    assert finding is not None
    assert "AIRSPEED_MIN 12" in finding.evidence


@pytest.mark.parametrize(
    ("done_s", "told"),
    [
        (35.0, []),
        (48.0, [("the transition to the wings takes too long", "warning")]),
        (None, [("it never went over to its wings", "critical")]),
    ],
)
def test_a_transition_of_a_quadplane(done_s: float | None, told: list[tuple[str, str]]) -> None:
    flown = MadePlane()
    flown.settings |= {"Q_ENABLE": 1, "Q_TRANSITION_MS": 5000}
    flown.rows["MSG"].append((25.0, {"Message": "Transition started airspeed 0.9"}))
    if done_s is not None:
        flown.rows["MSG"].append((done_s, {"Message": "Transition done"}))
    assert [(one.title, one.severity) for one in every_finding(flown.find()) if one.kind == "thrust"] == told


@pytest.mark.parametrize(("scale", "named"), [(1.1, True), (0.0, False)])
def test_a_take_off_that_its_time_limit_ended_names_the_limit(scale: float, named: bool) -> None:
    flown = MadePlane()
    flown.settings |= {"Q_ENABLE": 1, "Q_TKOFF_FAIL_SCL": scale}
    flown.rows["MSG"].append((27.0, {"Message": "Failed to complete takeoff within time limit"}))
    found = [one for one in every_finding(flown.find()) if one.kind == "takeoff"]
    assert [(one.onset_s, one.parameters, one.severity) for one in found] == [
        (27.0, ("Q_TKOFF_FAIL_SCL",), "critical")
    ] * named


@pytest.mark.parametrize("pulse_most", [2000.0, 0.0])
@pytest.mark.parametrize(("spin_most", "suspect"), [(0.6, "parameter"), (0.95, "hardware")])
def test_a_quadplane_that_stays_on_the_ground_with_all_its_lift(
    spin_most: float, suspect: str, pulse_most: float
) -> None:
    flown = MadePlane()
    flown.settings |= {"Q_ENABLE": 1, "Q_M_SPIN_MAX": spin_most, "Q_M_PWM_MAX": pulse_most}
    for name in ("POS", "GPS"):
        for field, standing in flown.table[name].items():
            flown.table[name][field] = np.full(len(standing), standing[0])
    flown.table["GPS"]["Spd"][:] = 0.0
    flown.table["CTUN"]["As"][:] = 0.0
    flown.table["QTUN"] = {"ThO": np.where((flown.t > 12.0) & (flown.t < DOWN_S), 1.0, 0.0)}
    finding = next(one for one in every_finding(flown.find()) if one.title == "too little thrust to take off")
    assert (finding.severity, finding.suspect) == ("critical", suspect)
    assert finding.onset_s == pytest.approx(12.0, abs=0.5)
    assert finding.wanted == ((("Q_M_SPIN_MAX", 0.95),) if suspect == "parameter" else ())


def test_a_quadplane_that_takes_off_with_all_its_lift_may_climb() -> None:
    flown = MadePlane()
    flown.settings |= {"Q_ENABLE": 1, "Q_M_SPIN_MAX": 0.6}
    flown.table["QTUN"] = {"ThO": np.where((flown.t > 10.0) & (flown.t < 25.0), 1.0, 0.0)}
    assert not any("take off" in one.title for one in every_finding(flown.find()))


def test_a_record_that_lost_its_attitude_for_a_while_is_read() -> None:
    """A plane of which an attitude stands still for a while was once read with arrays of two lengths."""
    flown = MadePlane()
    still = flown.after(40.0, 50.0)
    for name in ("Roll", "Pitch", "Yaw"):
        flown.table["ATT"][name][still] = flown.table["ATT"][name][still][0]
    titles = [one.title for one in every_finding(flown.find())]
    assert "the attitude is frozen" in titles


@pytest.mark.parametrize("rate_hz", RATES_HZ)
@pytest.mark.parametrize(("number", "place"), [(1, "front right"), (2, "rear left"), (3, "front left")])
def test_a_lift_motor_that_gives_too_little_when_it_lands(rate_hz: float, number: int, place: str) -> None:
    flown = hovering(rate_hz)
    flown.table["RCOU"][f"C{4 + number}"][flown.after(DOWN_S - 6.0, DOWN_S)] += 300.0
    finding = found(flown, "motor")
    assert finding is not None
    assert finding.title == f"motor {number} ({place}) lost thrust"
    assert finding.severity == "critical"
    assert finding.onset_s == pytest.approx(DOWN_S - 6.0, abs=2.5)


@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_what_lift_motors_do_while_it_flies_by_its_wing_tells_nothing(rate_hz: float) -> None:
    flown = hovering(rate_hz)
    helping = flown.after(40.0, 60.0)
    for n in range(5, 9):
        flown.table["RCOU"][f"C{n}"][helping] = 1400.0
    flown.table["RCOU"]["C6"][helping] = 1900.0
    assert found(flown, "motor") is None


def hovering(rate_hz: float) -> MadePlane:
    """A QuadPlane that hovers after it took off and before it lands, on four even motors."""
    flown = MadePlane(rate_hz)
    flown.settings |= {"Q_ENABLE": 1, "Q_FRAME_CLASS": 1, "Q_FRAME_TYPE": 1, "Q_M_PWM_MIN": 1000, "Q_M_PWM_MAX": 2000,
                       **{f"SERVO{n}_FUNCTION": 28 + n for n in range(5, 9)}}  # fmt: skip
    hovers = flown.after(10.5, 20.0) | flown.after(DOWN_S - 6.0, DOWN_S)
    flown.table["GPS"]["Spd"][hovers] = 0.3
    for n in range(5, 9):
        flown.table["RCOU"][f"C{n}"] = np.where(hovers, 1550 + flown.noise(5.0), 1000.0)
    return flown


@pytest.mark.parametrize(
    ("trim", "bank", "told"), [(1800.0, -20.0, True), (1800.0, 0.0, False), (1500.0, -20.0, False)]
)
def test_a_rudder_that_its_trim_holds_over_is_shown_by_the_bank(trim: float, bank: float, told: bool) -> None:
    flown = MadePlane()
    flown.settings |= {"SERVO4_FUNCTION": 21, "SERVO4_TRIM": trim}
    flown.table["RCOU"]["C4"] = np.full_like(flown.t, trim)
    straight = (flown.t > 14) & ((flown.t < 25) | (flown.t > 80))
    flown.table["ATT"]["Roll"] = flown.table["ATT"]["Roll"] + bank * straight
    title = "it flies straight with a bank: the rudder is held over"
    named = [one.parameters for one in flown.find() if one.title == title]
    assert named == ([("SERVO4_TRIM",)] if told else [])


@pytest.mark.parametrize(("trim", "held", "wanted"), [
    (1155.0, 1494.0, (("SERVO1_TRIM", 1500.0),)),  # where it flies straight the default is meant
    (1400.0, 1620.0, (("SERVO1_TRIM", 1620.0),)),
    (1400.0, 1410.0, None),  # a trim of one's own that is right
    (1500.0, 1500.0, None),
])  # fmt: skip
def test_an_aileron_trim_is_where_straight_flight_holds_it(
    trim: float, held: float, wanted: tuple[tuple[str, float], ...] | None
) -> None:
    flown = MadePlane()
    flown.settings |= {"SERVO1_TRIM": trim, "SERVO1_MIN": 1100.0, "SERVO1_MAX": 1900.0}
    flown.table["RCOU"]["C1"] = flown.table["RCOU"]["C1"] - 1500.0 + held
    title = "the trim of the ailerons is not their middle"
    named = [one.wanted for one in every_finding(flown.find()) if one.title == title]
    assert named == ([] if wanted is None else [wanted])


def test_an_elevator_that_trims_the_speed_as_well_has_no_wrong_trim() -> None:
    flown = MadePlane()
    flown.settings |= {"SERVO2_TRIM": 1440.0}
    flown.table["RCOU"]["C2"] = flown.table["RCOU"]["C2"] + 10.0
    assert found(flown, "surface") is None
    flown.settings |= {"SERVO2_TRIM": 1200.0}
    finding = found(flown, "surface")
    assert finding is not None
    assert (finding.title, finding.wanted) == ("the trim of the elevator is not its middle", (("SERVO2_TRIM", 1500.0),))


@pytest.mark.parametrize("offset", [0.0, 2000.0])
def test_a_surface_whose_trim_is_off_is_not_reversed(offset: float) -> None:
    """Out by 45% of its travel in straight flight, it turns the plane left when it is out by less than that."""
    flown = MadePlane()
    now = flown.after(50.0, 53.0)
    flown.table["AETR"]["Ail"] = flown.table["AETR"]["Ail"] + offset
    flown.table["AETR"]["Ail"][now] = 1800.0
    flown.table["PIDR"]["Tar"][now] = 10.0
    flown.table["PIDR"]["Act"][now] = -20.0
    flown.table["ATT"]["Roll"][now] -= 20.0 * (flown.t[now] - 50.0)
    titles = [one.title for one in every_finding(flown.find())]
    assert ("the ailerons no longer obey" in titles) == (offset == 0.0)


@pytest.mark.parametrize(("blow", "keeps", "is_told"), [(400.0, 0.5, True), (60.0, 0.5, False), (400.0, 0.95, False)])
def test_a_plane_that_hits_the_ground_and_flies_on_is_told(blow: float, keeps: float, is_told: bool) -> None:
    made = MadePlane()
    dive = np.interp(made.t, [50.0, 54.0, 54.5, 60.0], [0.0, HEIGHT_M - 1.0, HEIGHT_M - 1.0, 0.0])
    for name, field in (("POS", "RelHomeAlt"), ("BARO", "Alt"), ("BARO#2", "Alt"), ("GPS", "Alt")):
        made.table[name][field] -= dive
    made.table["GPS"]["Spd"][made.after(54.3, 58.0)] *= keeps
    for table in ("IMU", "IMU#2"):
        made.table[table]["AccZ"] += made.noise(2.0)  # its motor shakes it on
        made.table[table]["AccZ"][made.after(54.2, 54.25)] = -blow
    titles = [one.title for one in every_finding(made.find())]
    assert ("it hit the ground at 18 m/s and flew on" in titles) is is_told


@pytest.mark.parametrize(("lean_deg", "is_told"), [(66.0, True), (12.0, False)])
def test_a_plane_that_comes_down_fast_and_lies_on_its_side_hit_the_ground(lean_deg: float, is_told: bool) -> None:
    made = MadePlane()
    falls, lies = (made.t > 70.0) & (made.t <= 75.0), made.t > 75.0
    height = np.where(falls, 60.0 - 12.0 * (made.t - 70.0), np.where(lies, 0.0, made.table["POS"]["RelHomeAlt"]))
    made.table["POS"]["RelHomeAlt"] = height
    made.table["GPS"]["Spd"][lies] = 0.0
    made.table["ATT"]["Roll"][lies] = lean_deg
    assert any(one.title.startswith("it hit the ground at 12") for one in every_finding(made.find())) == is_told


@pytest.mark.parametrize(("fitted", "is_told"), [(2.0, True), (0.0, False)])
def test_an_airspeed_sensor_that_is_used_and_reads_nothing_in_the_air_is_told(fitted: float, is_told: bool) -> None:
    made = MadePlane()
    made.settings["ARSPD_TYPE"] = fitted
    made.table["ARSP"]["Airspeed"] = 0.1 * np.abs(made.noise(0.1))
    assert (SENSOR_SILENT in {one.title for one in every_finding(made.find())}) == is_told


@pytest.mark.parametrize(("pitch", "is_told"), [(-12.0, True), (8.0, False)], ids=["nose down", "nose up"])
def test_an_elevator_that_is_up_while_the_nose_stays_down(pitch: float, is_told: bool) -> None:
    made = MadePlane()
    runs = made.after(16.0)
    made.table["POS"]["RelHomeAlt"][:] = made.noise(0.02)
    made.table["GPS"]["Spd"][runs] = CRUISE_MS + 5.0
    made.table["AETR"]["Elev"][runs] = 4300.0
    made.table["ATT"]["Pitch"][runs] = pitch
    made.table["PIDP"]["Tar"][runs], made.table["PIDP"]["Act"][runs] = 60.0, made.noise(0.5)[runs]
    titles = [one.title for one in every_finding(made.find())]
    assert ("the elevator is up, and the nose stays down" in titles) == is_told


@pytest.mark.parametrize(("gusts", "is_struck"), [(18.0, False), (2.0, True)], ids=["in gusts", "in calm air"])
def test_gusts_on_wings_are_no_blow_before_control_is_lost(gusts: float, is_struck: bool) -> None:
    made = MadePlane()
    for name in ("IMU", "IMU#2"):
        made.table[name]["AccZ"] += gusts * np.sin(2 * np.pi * made.t / 0.7) * (made.t > 30.0)
        made.table[name]["AccZ"][made.after(49.9, 50.05)] = -38.0
    made.table["ATT"]["Roll"] -= 100.0 * np.clip(made.t - 50.0, 0.0, None) * (made.t < DOWN_S)
    flight = made.flight()
    assert flight.lost_control_s == pytest.approx(50.3, abs=0.5)
    assert (flight.struck_s is not None) is is_struck


@pytest.mark.parametrize(
    ("airspeed", "throttle", "is_told"), [(13.0, 100.0, True), (13.0, 60.0, False), (17.0, 100.0, False)],
    ids=["slow at full throttle", "slow", "nearly as fast as it cruises"],
)  # fmt: skip
def test_full_throttle_that_does_not_bring_a_plane_to_its_airspeed(
    airspeed: float, throttle: float, is_told: bool
) -> None:
    flown = MadePlane()
    level = flown.after(40.0, 70.0)
    flown.table["CTUN"]["As"][level] = airspeed
    flown.table["CTUN"]["ThO"][level] = throttle
    titles = [one.title for one in every_finding(flown.find())]
    assert ("full throttle does not bring it to its airspeed" in titles) == is_told

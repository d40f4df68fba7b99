"""PX4 vehicles that stay on the ground though nothing of their flight is wrong, and missions that land on their way."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.diagnose.parts import never_flew
from care_core.ecosystems.findings import (
    HASTY,
    NO_MISSION,
    NO_POSITION_FOR,
    NOT_BEGUN,
    SPINS,
    UNPOWERED,
    Finding,
    every_finding,
)
from care_core.ecosystems.px4.examining import examine
from care_core.ecosystems.px4.failsafes import in_words
from care_core.ecosystems.px4.flight import Px4Flight
from care_core.logs.base import Table
from care_core.run import Setting, Unavailable
from tests.unit.test_px4_health import MadeLog, states
from tests.unit.test_px4_measures import BEGUN_S, item, mission, table, value

TAKEOFF, PLACE, LAND, RETURN = 22, 16, 21, 20
FIELDS = ("sequence_current", "nav_cmd", "latitude", "longitude", "altitude", "time_inside", "altitude_is_relative")


def found(**topics: Table) -> tuple[Finding, ...]:
    return tuple(every_finding(examine(Px4Flight(MadeLog(dict(topics)))).findings))


def on_ground(amps: float, *, last_mode: float = 3.0) -> tuple[Finding, ...]:
    """A flight that asks for all the thrust from 20 s on and stays where it is, its battery giving so much."""
    battery = states(voltage_v=[(0, 12.0)], current_a=[(0, 0.05), (20, amps)])
    return found(
        vehicle_status=states(arming_state=[(0, 1), (10, 2), (50, 1)], nav_state=[(0, 3), (45, last_mode)],
                              failsafe=[(0, 0)]),
        vehicle_local_position=states(z=[(0, 0.0)], vz=[(0, 0.0)]),
        vehicle_local_position_setpoint=states(vz=[(0, 0.0), (20, -1.5)]),
        vehicle_thrust_setpoint=states(**{"xyz[2]": [(0, 0.0), (20, -1.0)]}),
        battery_status=battery,
    )  # fmt: skip


@pytest.mark.parametrize(("amps", "title"), [(0.2, UNPOWERED), (12.0, "too little thrust")])
def test_what_draws_hardly_any_power_has_none_at_its_motors(amps: float, title: str) -> None:
    thrust = [one for one in on_ground(amps) if one.kind == "thrust"]
    assert [one.title for one in thrust] == [title]
    assert never_flew(thrust) == (title == UNPOWERED)


def test_a_bench_run_that_somebody_broke_off_did_not_fail() -> None:
    (one,) = [one for one in on_ground(0.2, last_mode=0.0) if one.kind == "thrust"]
    assert (one.title, one.severity) == (UNPOWERED, "warning")
    assert not never_flew([one])


@pytest.mark.parametrize(("amps", "lean_deg", "is_told"), [(0.2, 30.0, True), (0.2, 3.0, False), (12.0, 30.0, False)])
def test_what_is_carried_about_while_it_is_to_lift_has_no_power(amps: float, lean_deg: float, is_told: bool) -> None:
    half = np.radians(lean_deg) / 2
    titles = [
        one.title
        for one in found(
            vehicle_status=states(arming_state=[(0, 1), (10, 2), (50, 1)], nav_state=[(0, 3)], failsafe=[(0, 0)]),
            vehicle_local_position=states(z=[(0, 0.0), (25, -1.5)], vz=[(0, 0.0), (20, -1.5)]),
            vehicle_local_position_setpoint=states(vz=[(0, 0.0), (20, -1.5)]),
            vehicle_thrust_setpoint=states(**{"xyz[2]": [(0, 0.0), (20, -0.8)]}),
            battery_status=states(voltage_v=[(0, 12.0)], current_a=[(0, 0.05), (20, amps)]),
            vehicle_attitude=states(**quaternion(float(np.cos(half)), float(np.sin(half)))),
            vehicle_attitude_setpoint=states(**quaternion(1.0, 0.0, "q_d")),
        )
    ]
    assert (UNPOWERED in titles) == is_told


def test_what_stays_on_the_ground_while_it_is_to_lift_has_no_power() -> None:
    titles = [
        one.title
        for one in found(
            vehicle_status=states(arming_state=[(0, 1), (10, 2), (50, 1)], nav_state=[(0, 3)], failsafe=[(0, 0)]),
            vehicle_local_position=states(z=[(0, 0.0)], vz=[(0, 0.0)]),
            vehicle_local_position_setpoint=states(vz=[(0, 0.0)]),  # it is asked for no climb
            vehicle_thrust_setpoint=states(**{"xyz[2]": [(0, 0.0), (20, -0.6)]}),
            battery_status=states(voltage_v=[(0, 12.0)], current_a=[(0, 0.05), (20, 0.2)]),
        )
    ]
    assert UNPOWERED in titles


@pytest.mark.parametrize(
    ("amps", "felt", "is_told"), [(0.0, 1.0, True), (12.0, 1.0, False), (0.0, 9.8, False)],
    ids=["it falls without current", "it falls", "it flies"],
)  # fmt: skip
def test_motors_that_lose_their_power_in_the_air_are_told(amps: float, felt: float, is_told: bool) -> None:
    asked = [(0.0, 0.0), (12.0, 0.6), (30.0, 1.0), (32.0, 0.0)]
    log = MadeLog(
        {
            "vehicle_status": states(arming_state=[(0, 1), (10, 2), (50, 1)], nav_state=[(0, 2)], failsafe=[(0, 0)],
                                     vehicle_type=[(0, 1)]),
            "vehicle_local_position": states(z=[(0, 0.0), (13, -5.0), (32, 0.0)], vz=[(0, 0.0)]),
            "battery_status": states(voltage_v=[(0, 11.5)], current_a=[(0, 0.3), (12, 18.0), (30, amps), (31, 0.0)]),
            "actuator_motors": states(**{f"control[{n}]": asked for n in range(4)}),
            "sensor_combined": states(**{f"accelerometer_m_s2[{n}]": [(0, 0.0)] for n in range(2)},
                                      **{"accelerometer_m_s2[2]": [(0, -9.8), (30, -felt), (31, -9.8)]}),
        },
        parameters={"CA_ROTOR_COUNT": (Setting("CA_ROTOR_COUNT", 4.0, "PARM"),)},
    )  # fmt: skip
    titles = [one.title for one in every_finding(examine(Px4Flight(log)).findings)]
    assert ("the motors lost their power in the air" in titles) == is_told


def quaternion(w: float, x: float, name: str = "q") -> dict[str, list[tuple[float, float]]]:
    return {f"{name}[{n}]": [(0.0, value)] for n, value in enumerate((w, x, 0.0, 0.0))}


def test_what_flew_before_it_lay_had_power() -> None:
    draws = {"voltage_v": [(0.0, 12.0)], "current_a": [(0.0, 0.05), (20.0, 15.0), (30.0, 0.05)]}
    topics = {
        "vehicle_status": states(arming_state=[(0, 1), (10, 2), (50, 1)], nav_state=[(0, 3)], failsafe=[(0, 0)]),
        "vehicle_local_position": states(z=[(0, 0.0)], vz=[(0, 0.0), (20, -1.5)]),
        "vehicle_local_position_setpoint": states(vz=[(0, 0.0), (20, -1.5)]),
        "vehicle_thrust_setpoint": states(**{"xyz[2]": [(0, 0.0), (20, -0.8)]}),
        "vehicle_attitude": states(**quaternion(0.0, 1.0)),
        "vehicle_attitude_setpoint": states(**quaternion(1.0, 0.0, "q_d")),
    }
    assert UNPOWERED not in [one.title for one in found(**topics, battery_status=states(**draws))]


def test_a_current_that_is_not_measured_tells_of_no_power() -> None:
    assert [one.title for one in on_ground(0.05) if one.kind == "thrust"] == ["too little thrust"]


@pytest.mark.parametrize(
    ("before", "mode", "thrust", "said", "is_told"),
    [(3.0, 3.0, 0.0, "", True), (3.0, 3.0, -0.5, "", False), (2.0, 2.0, 0.0, "", False), (2.0, 3.0, 0.0, "", True),
     (2.0, 3.0, -0.13, "Disarmed by auto preflight disarming", True), (2.0, 3.0, -0.13, "Disarmed by RC", False),
     (3.0, 3.0, -0.15, "Disarmed by auto preflight disarming", False)],
)  # fmt: skip
def test_a_mission_that_is_not_flown_though_it_was_armed_for_it_never_began(
    before: float, mode: float, thrust: float, said: str, is_told: bool
) -> None:
    titles = [
        one.title
        for one in found(
            vehicle_status=states(arming_state=[(0, 1), (10, 2), (20, 1)], nav_state=[(0, before), (18, mode)],
                                  failsafe=[(0, 0)]),
            logged_messages=Table(np.array([20.0]), {"level": np.array(["INFO"]), "message": np.array([said])}),
            vehicle_land_detected=states(landed=[(0, 1)]),
            vehicle_thrust_setpoint=states(**{"xyz[2]": [(0, thrust)]}),
            mission_result=states(finished=[(0, 1)], seq_reached=[(0, -1)], seq_total=[(0, 5)]),
        )
    ]  # fmt: skip
    assert (NOT_BEGUN in titles) == is_told


@pytest.mark.parametrize(
    ("waits_s", "spools_s", "named"),
    [(10.0, 20.0, ("COM_SPOOLUP_TIME",)), (0.5, 1.0, ("COM_DISARM_PRFLT",)), (10.0, 1.0, ()), (-1.0, 20.0, ())],
)
def test_a_vehicle_that_is_disarmed_while_it_spools_up_was_set_so(
    waits_s: float, spools_s: float, named: tuple[str, ...]
) -> None:
    held = {"COM_DISARM_PRFLT": (waits_s, 10.0), "COM_SPOOLUP_TIME": (spools_s, 1.0)}
    log = MadeLog(
        {
            "vehicle_status": states(arming_state=[(0, 1), (10, 2), (20, 1)], nav_state=[(0, 3)], failsafe=[(0, 0)]),
            "logged_messages": Table(np.array([20.0]), {"level": np.array(["INFO"]), "message": np.array(
                ["Disarmed by auto preflight disarming"])}),
        },
        parameters={name: (Setting(name, value, "PARM", default=shipped),) for name, (value, shipped) in held.items()},
    )  # fmt: skip
    told = [one for one in examine(Px4Flight(log)).findings if one.title == HASTY]
    assert [one.parameters for one in told] == ([named] if named else [])


@pytest.mark.parametrize(
    ("said", "reached", "is_told"),
    [("No valid mission available, loitering", -1, True), ("No valid mission available, loitering", 2, False),
     ("Mission finished, loitering", -1, False)],
)  # fmt: skip
def test_a_mission_that_the_navigator_does_not_fly_is_told_in_its_words(said: str, reached: int, is_told: bool) -> None:
    titles = [
        one.title
        for one in found(
            vehicle_status=states(arming_state=[(0, 1), (10, 2), (30, 1)], nav_state=[(0, 0), (12, 4)],
                                  failsafe=[(0, 0)]),
            mission_result=states(finished=[(0, 1)], seq_reached=[(0, reached)], seq_total=[(0, 15)]),
            logged_messages=Table(np.array([12.0]), {"level": np.array(["INFO"]), "message": np.array([said])}),
        )
    ]  # fmt: skip
    assert (NO_MISSION in titles) == is_told


POSITION_MODE, ALTITUDE_MODE = 2, 1


@pytest.mark.parametrize(
    ("intended", "known_s", "knows_attitude", "is_told"),
    [(POSITION_MODE, 99.0, True, True), (POSITION_MODE, 5.0, True, False), (ALTITUDE_MODE, 99.0, True, False),
     (POSITION_MODE, 99.0, False, False)],
)  # fmt: skip
def test_a_position_mode_without_a_position_is_told(
    intended: int, known_s: float, knows_attitude: bool, is_told: bool
) -> None:
    flags = states(
        local_position_invalid=[(0, 1), (known_s, 0), (15, 1)] if known_s < 15 else [(0, 1)],
        mode_req_local_position_relaxed=[(0, 1 << POSITION_MODE)],
        attitude_invalid=[(0, int(not knows_attitude))],
        offboard_control_signal_lost=[(0, 1)],
        mode_req_offboard_signal=[(0, 1 << 14)],
    )
    status = states(
        arming_state=[(0, 1), (10, 2), (50, 1)],
        nav_state=[(0, 0), (20, ALTITUDE_MODE)],
        nav_state_user_intention=[(0, 0), (20, intended)],
        failsafe=[(0, 0), (20, 1)],
    )
    flight = Px4Flight(MadeLog({"vehicle_status": status, "failsafe_flags": flags}))
    titles = [one.title for one in every_finding(examine(flight).findings)]
    assert (f"Position{NO_POSITION_FOR}" in titles) == is_told
    if knows_attitude:
        assert in_words(flight, 20.0) == ("position" if intended == POSITION_MODE else "")


@pytest.mark.parametrize(
    ("rate", "wanted", "thrust", "is_told"),
    [(-3.5, 1.5, -0.3, True), (-3.5, -2.5, -0.3, False), (-1.0, 1.5, -0.3, False), (-3.5, 1.5, 0.0, False)],
)  # fmt: skip
def test_a_vehicle_that_spins_against_its_control_is_told(
    rate: float, wanted: float, thrust: float, is_told: bool
) -> None:
    titles = [
        one.title
        for one in found(
            vehicle_status=states(arming_state=[(0, 1), (10, 2), (50, 1)], nav_state=[(0, 14)], failsafe=[(0, 0)]),
            vehicle_land_detected=states(landed=[(0, 1), (12, 0), (48, 1)]),
            vehicle_angular_velocity=states(**{"xyz[2]": [(0, 0.0), (30, rate), (34, 0.0)]}),
            vehicle_rates_setpoint=states(yaw=[(0, 0.0), (30, wanted)]),
            vehicle_thrust_setpoint=states(**{"xyz[2]": [(0, 0.0), (12, thrust)]}),
        )
    ]
    assert (SPINS in titles) == is_told


def test_a_spin_whose_demand_turns_around_with_every_half_turn_is_told() -> None:
    demand = [(30.0 + 0.9 * n, 2.2 if n % 2 else -2.2) for n in range(8)]
    titles = [
        one.title
        for one in found(
            vehicle_status=states(arming_state=[(0, 1), (10, 2), (50, 1)], nav_state=[(0, 14)], failsafe=[(0, 0)]),
            vehicle_land_detected=states(landed=[(0, 1), (12, 0), (48, 1)]),
            vehicle_angular_velocity=states(**{"xyz[2]": [(0, 0.0), (30, -3.0), (37, 0.0)]}),
            vehicle_rates_setpoint=states(yaw=[(0, 0.0), *demand, (37.5, 0.0)]),
            vehicle_thrust_setpoint=states(**{"xyz[2]": [(0, 0.0), (12, -0.5)]}),
        )
    ]
    assert SPINS in titles


def landing_on_the_way() -> Table:
    """Out 100 m, a landing there, and back again."""
    there, home = (0.0, 100.0, 20.0), (0.0, 0.0, 20.0)
    ways = ((TAKEOFF, home), (PLACE, there), (LAND, there), (TAKEOFF, there), (PLACE, home), (LAND, home))
    begun = np.linspace(5.0, BEGUN_S[-1] + 15.0, len(ways)).tolist()
    return table([item(t, n, *way) for n, (t, way) in enumerate(zip(begun, ways, strict=True))], *FIELDS)


def test_a_mission_that_lands_on_its_way_ends_where_it_lands_last() -> None:
    result = [(5.0, -1.0), *((20.0 + 15.0 * n, float(n)) for n in range(6))]
    rows: list[tuple[float, ...]] = [(t, n, 6.0, 0.0, 0.0, 1.0, 1.0) for t, n in result]
    fields = ("seq_reached", "seq_total", "finished", "failure", "mission_id", "instance_count")
    flight = mission(navigator_mission_item=landing_on_the_way(), mission_result=table(rows, *fields))
    assert value("px4_landing_error", flight) == pytest.approx(0.0, abs=1.0)
    assert value("px4_mission_success", flight) == 1.0
    asked = value("px4_mission_asked", flight, what="path_length")
    assert isinstance(asked, Unavailable)
    assert "lands on its way" in asked.reason
    assert value("px4_path_error", flight) == asked


def leaning(*degrees: tuple[float, float], height_m: float = 10.0) -> list[str]:
    """Findings of the attitude of a hover that was to be level, and leant so far from given times on."""
    half = [(t, np.radians(lean) / 2) for t, lean in ((0.0, 0.0), *degrees)]
    roll: dict[str, list[tuple[float, float]]] = {
        "q[0]": [(t, float(np.cos(a))) for t, a in half], "q[1]": [(t, float(np.sin(a))) for t, a in half],
        "q[2]": [(0, 0.0)], "q[3]": [(0, 0.0)],
    }  # fmt: skip
    level: dict[str, list[tuple[float, float]]] = {"q_d[0]": [(0, 1.0)]}
    level |= {f"q_d[{n}]": [(0, 0.0)] for n in (1, 2, 3)}
    findings = found(
        vehicle_status=states(arming_state=[(0, 1), (10, 2), (50, 1)], nav_state=[(0, 2)], failsafe=[(0, 0)],
                              vehicle_type=[(0, 1)]),
        vehicle_land_detected=states(landed=[(0, 1), (12, 0), (48, 1)]),
        vehicle_local_position=states(z=[(0, 0.0), (13, -height_m), (47, 0.0)], vz=[(0, 0.0)]),
        vehicle_attitude=states(**roll),
        vehicle_attitude_setpoint=states(**level),
    )  # fmt: skip
    return [one.title for one in findings if one.kind == "attitude"]


def test_an_attitude_that_left_its_demand_and_came_back_is_told() -> None:
    off = "the attitude does not follow its demand"
    assert leaning((25.0, 60.0), (25.6, 0.0), (26.0, -70.0), (26.6, 0.0)) == [off]
    assert leaning((25.0, 110.0), (26.2, 0.0)) == ["it tumbled in the air and caught itself"]
    assert leaning((25.0, 40.0), (25.4, 0.0), (40.0, 40.0), (40.4, 0.0)) == []  # flicks of a stick
    assert leaning((25.0, 90.0)) == ["control was lost"]


def test_what_leans_over_as_it_is_to_lift_and_stays_so_is_told() -> None:
    over = ["it leaned over on the ground and did not lift"]
    assert leaning((14.0, 25.0), height_m=0.2) == over
    assert leaning((14.0, 25.0), (30.0, 0.0), height_m=0.2) == []  # it stood up again
    assert leaning((14.0, 25.0), height_m=3.0) == []  # it flew, and 25 degrees off are no loss of control
    assert leaning((48.0, 25.0), height_m=0.2) == []  # as it is switched off


@pytest.mark.parametrize(
    ("landed", "speed", "said"), [(0, 7.0, "coming down at 7.0 m/s"), (0, 0.2, "armed 10 m up at"), (1, 0.2, "")]
)
def test_a_log_that_ends_in_the_air_is_told(landed: int, speed: float, said: str) -> None:
    findings = found(
        vehicle_status=states(arming_state=[(0, 1), (10, 2)], nav_state=[(0, 2)], failsafe=[(0, 0)]),
        vehicle_land_detected=states(landed=[(0, 1), (12, landed)]),
        vehicle_local_position=states(z=[(0, 0.0), (13, -10.0)], vz=[(0, 0.0), (59, speed)]),
    )
    told = [one.evidence for one in findings if one.title == "the log ends in the air"]
    assert bool(told) == bool(said)
    assert all(said in one for one in told)


@pytest.mark.parametrize(
    ("pair", "others", "is_told"), [(0.93, 0.54, True), (0.6, 0.3, False), (0.85, 0.8, False)]
)  # fmt: skip
def test_motors_that_turn_one_way_and_work_much_harder_are_told(pair: float, others: float, is_told: bool) -> None:
    spins = {"CA_ROTOR_COUNT": 4.0, **{f"CA_ROTOR{n}_KM": 0.05 if n < 2 else -0.05 for n in range(4)}}
    asked = {f"control[{n}]": [(0.0, 0.0), (12.0, others if n < 2 else pair), (48.0, 0.0)] for n in range(4)}
    log = MadeLog(
        {
            "vehicle_status": states(arming_state=[(0, 1), (10, 2), (50, 1)], nav_state=[(0, 2)], failsafe=[(0, 0)],
                                     vehicle_type=[(0, 1)]),
            "vehicle_land_detected": states(landed=[(0, 1), (12, 0), (48, 1)]),
            "vehicle_local_position": states(z=[(0, 0.0), (13, -10.0), (47, 0.0)], vz=[(0, 0.0)]),
            "actuator_motors": states(**asked),
        },
        parameters={name: (Setting(name, value, "PARM"),) for name, value in spins.items()},
    )  # fmt: skip
    titles = [one.title for one in every_finding(examine(Px4Flight(log)).findings)]
    assert ("motors 3 and 4 work harder than those that turn the other way" in titles) == is_told

"""PX4: thrust at its end that does not give the vertical speed wanted, and flights that end above the ground."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.ecosystems.findings import Finding, every_finding
from care_core.ecosystems.px4.examining import examine
from care_core.ecosystems.px4.flight import Px4Flight
from care_core.ecosystems.px4.missions import _checks
from care_core.logs.base import Table
from care_core.run import Setting, Unavailable
from tests.unit.test_px4_health import FLOWN, MadeLog, states

ARMED = (10.0, 50.0)


def found(
    lift: float,
    sinks: float,
    wanted: float,
    lasts_s: float,
    baro: float = 1.0,
    leans_deg: float = 0.0,
    **parameters: float,
) -> list[Finding]:
    """Findings of a flight that hovers, and from 20 s on, for a time, is asked for a lift and sinks so fast (m/s), so
    many degrees off its demand all the time."""
    half = np.radians(leans_deg) / 2
    lean = {
        "q[0]": [(0, float(np.cos(half)))],
        "q[1]": [(0, float(np.sin(half)))],
        "q[2]": [(0, 0.0)],
        "q[3]": [(0, 0.0)],
    }
    level = {"q_d[0]": [(0, 1.0)], **{f"q_d[{n}]": [(0, 0.0)] for n in (1, 2, 3)}}
    shipped = {"MPC_THR_MIN": 0.12, "MPC_THR_MAX": 1.0}
    held = {name: (Setting(name, value, "ulog", shipped[name]),) for name, value in parameters.items()}
    end = 20.0 + lasts_s
    steps = [(0.0, 0.0), *((20.0 + 0.1 * n, sinks * 0.1 * n) for n in range(int(10 * lasts_s)))]
    log = MadeLog({
        "vehicle_status": FLOWN,
        "vehicle_attitude": states(**lean),
        "vehicle_attitude_setpoint": states(**level),
        "vehicle_local_position": states(z=[(0, 0.0), *((t, -5.0 + z) for t, z in steps[1:])],
                                         vz=[(0, 0.0), (20, sinks), (end, 0.0)]),
        "vehicle_local_position_setpoint": states(vz=[(0, 0.0), (20, wanted), (end, 0.0)]),
        "vehicle_thrust_setpoint": states(**{"xyz[2]": [(0, -0.5), (20, -lift), (end, -0.5)]}),
        "vehicle_air_data": states(baro_alt_meter=[(0, 400.0), *((t, 405.0 - baro * z) for t, z in steps[1:])]),
    }, parameters=held)  # fmt: skip
    return [one for one in every_finding(examine(Px4Flight(log)).findings) if one.kind == "thrust"]


@pytest.mark.parametrize(
    ("lift", "sinks", "wanted", "lasts_s", "told"),
    [
        (1.0, -0.2, -1.5, 8.0, [("warning", "too little thrust")]),
        (1.0, -1.4, -1.5, 8.0, []),  # it climbs as it is told
        (0.9, -0.2, -1.5, 8.0, []),  # there is thrust left
        (1.0, -0.2, -1.5, 2.0, []),
        (0.12, -1.5, 1.8, 8.0, [("critical", "it rises with the motors at their least")]),
        (0.12, -1.5, 1.8, 4.0, [("warning", "it rises with the motors at their least")]),
        (0.12, 1.5, 1.8, 8.0, []),  # it sinks as it is told
    ],
)
def test_thrust_at_its_end(
    lift: float, sinks: float, wanted: float, lasts_s: float, told: list[tuple[str, str]]
) -> None:
    assert [(one.severity, one.title) for one in found(lift, sinks, wanted, lasts_s)] == told


@pytest.mark.parametrize(
    ("lift", "sinks", "wanted", "name", "value", "default"),
    [(0.45, -1.5, 1.8, "MPC_THR_MIN", 0.45, 0.12), (0.6, -0.2, -1.5, "MPC_THR_MAX", 0.6, 1.0)],
)
def test_an_end_of_the_thrust_that_somebody_set_is_named(
    lift: float, sinks: float, wanted: float, name: str, value: float, default: float
) -> None:
    (one,) = found(lift, sinks, wanted, 8.0, **{name: value})
    assert (one.suspect, one.parameters, one.wanted) == ("parameter", (name,), ((name, default),))
    assert one.evidence.endswith(f"{name} is {value:g} (default {default:g})")
    (near,) = found(0.14, -1.5, 1.8, 8.0, MPC_THR_MIN=0.14)
    assert near.parameters == ()


def test_what_leans_off_its_demand_gives_its_thrust_for_that() -> None:
    assert [one.title for one in found(1.0, -0.2, -1.5, 8.0, leans_deg=10.0)] == ["too little thrust"]
    assert found(1.0, -0.2, -1.5, 8.0, leans_deg=20.0) == []


def test_a_climb_of_the_estimate_alone_is_none() -> None:
    assert found(0.12, -1.5, 1.8, 8.0, baro=0.1) == []


def checked(**topics: Table) -> dict[str, tuple[object, str]]:
    flight = Px4Flight(MadeLog({"vehicle_status": FLOWN, **topics}))
    return {one.name: (one.value, one.otherwise) for one in _checks(flight, ARMED, ended=True)}


def heights(up_m: float) -> Table:
    return states(z=[(0, 0.0), (12, -up_m)])


TERMINATED = states(arming_state=[(0, 1), (10, 2), (50, 1)], nav_state=[(0, 4), (40, 13)], failsafe=[(0, 0), (40, 1)])


def test_a_flight_that_the_firmware_ended_in_the_air() -> None:
    found = checked(vehicle_status=TERMINATED, vehicle_local_position=heights(6.0))
    assert found["no_crash"] == (0.0, "the firmware cut its motors in the air at 40.0 s, 6.0 m up")
    assert found["no_failsafe"] == (0.0, "a failsafe acted at 40.0 s")


@pytest.mark.parametrize(("up_m", "said"), [(0.1, "it never left the ground"), (-6.0, "its height runs off below")])
def test_a_height_that_runs_off_says_nothing_of_a_take_off(up_m: float, said: str) -> None:
    took_off = checked(vehicle_local_position=heights(up_m))["took_off"][0]
    assert isinstance(took_off, Unavailable)
    assert took_off.reason.startswith(said)


@pytest.mark.parametrize(("bit", "fell"), [(1, True), (128, False)], ids=["roll", "imbalanced propeller"])
def test_what_the_failure_detector_only_advises_of_ends_no_flight(bit: int, fell: bool) -> None:
    status = states(arming_state=[(0, 1), (10, 2), (50, 1)], nav_state=[(0, 2)], failsafe=[(0, 0)],
                    failure_detector_status=[(0, 0), (30, bit), (31, 0)])  # fmt: skip
    assert (checked(vehicle_status=status)["no_crash"][0] == 0.0) == fell


def test_a_failsafe_is_told_by_what_it_is_about() -> None:
    flags = states(offboard_control_signal_lost=[(0, 0), (39.9, 1)], battery_warning=[(0, 0), (45, 1)])
    found = checked(vehicle_status=TERMINATED, failsafe_flags=flags)
    assert found["no_failsafe"] == (0.0, "offboard link failsafe at 40.0 s")
    cut = Table(np.array([30.0]), {"level": np.array(["INFO"]), "message": np.array(["Kill engaged"])})
    assert checked(vehicle_status=TERMINATED, failsafe_flags=flags, logged_messages=cut)["no_failsafe"][0] == 1.0


def test_one_that_it_ended_on_the_ground_has_not_crashed() -> None:
    assert checked(vehicle_status=TERMINATED, vehicle_local_position=heights(0.1))["no_crash"][0] == 1.0
    assert isinstance(checked(vehicle_status=TERMINATED)["no_crash"][0], Unavailable)  # nobody knows where it was


@pytest.mark.parametrize(("landed_s", "landed"), [(49.0, 1.0), (50.3, 0.0)])
def test_disarming_itself_is_no_landing(landed_s: float, landed: float) -> None:
    detected = states(landed=[(0, 1), (12, 0), (landed_s, 1)])
    found = checked(vehicle_land_detected=detected, vehicle_local_position=heights(3.0))
    assert found["landed"] == (landed, "it was disarmed in the air")


@pytest.mark.parametrize(("up_m", "told"), [(5.0, "it came down and could not rise again"), (0.0, "too little thrust")])
def test_all_the_thrust_on_the_ground_after_a_flight_is_no_lack_of_it(up_m: float, told: str) -> None:
    """What lies there came down for another reason; what never left the ground is too heavy or has no thrust."""
    log = MadeLog({
        "vehicle_status": FLOWN,
        "vehicle_local_position": states(z=[(0, 0.0), (12, -up_m), (18, -up_m), (20, 0.0)], vz=[(0, 0.0)]),
        "vehicle_local_position_setpoint": states(vz=[(0, 0.0), (22, -3.0)]),
        "vehicle_thrust_setpoint": states(**{"xyz[2]": [(0, -0.5), (22, -1.0)]}),
    })  # fmt: skip
    findings = every_finding(examine(Px4Flight(log)).findings)
    assert [one.title for one in findings if one.kind == "thrust" or "rise" in one.title] == [told]

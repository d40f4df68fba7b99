"""Attitudes and headings that do not follow, and spins."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.ecosystems.findings import every_finding
from tests.flights import END_S, FAILS_S, HEIGHT_M, HOVER, UP_S, Made, first


def test_an_attitude_that_does_not_follow() -> None:
    made = Made()
    made.table["ATT"]["DesRoll"][made.after(FAILS_S, FAILS_S + 5)] += 22
    assert first(made).title == "the attitude does not follow its demand"


def test_a_heading_that_turns_to_a_demand_given_at_once_follows_it() -> None:
    made = Made()
    yaw = np.interp(made.t, [50.0, 54.0], [20.0, 199.0])
    made.table["ATT"].update({"Yaw": yaw, "DesYaw": np.where(made.t < 50.0, 20.0, 199.0)})
    assert not [one for one in made.find() if one.kind == "attitude"]
    made.table["ATT"]["Yaw"] = np.where(made.t < 54.0, yaw, 20.0 + 40.0 * (made.t - 54.0))  # and spins on
    assert [one.title for one in made.find() if one.kind == "attitude"] == ["the heading does not follow its demand"]


@pytest.mark.parametrize(("out", "told"), [(-0.5, True), (0.5, False)])
def test_a_turn_that_its_own_control_drives_on_is_told(out: float, told: bool) -> None:
    made = Made()
    turns = np.where((made.t > 40.0) & (made.t < 60.0), 30.0 + 3.0 * (made.t - 40.0), 0.0)
    pushes = np.where(turns > 0, out, 0.0)
    zero = np.zeros_like(made.t)
    made.table["RATE"] = {"R": zero, "P": zero, "RDes": zero, "PDes": zero, "ROut": zero, "POut": zero,
                          "Y": turns, "YDes": np.sign(pushes) * 60.0, "YOut": pushes}  # fmt: skip
    assert ("it spins against its control" in [one.title for one in made.find()]) is told


@pytest.mark.parametrize(("begins_dps", "told"), [(0.0, True), (150.0, False)])
def test_what_starts_to_turn_against_its_control_spins_and_what_stops_does_not(begins_dps: float, told: bool) -> None:
    made = Made()
    since = made.t - 40.0
    turns = np.where(since < 3.0, begins_dps + (60.0 - begins_dps) * since / 3.0, 60.0 - 10.0 * (since - 3.0))
    turns = np.where((since > 0.0) & (since < 7.0), turns, 0.0)
    zero = np.zeros_like(made.t)
    made.table["RATE"] = {"R": zero, "P": zero, "RDes": zero, "PDes": zero, "ROut": zero, "POut": zero,
                          "Y": turns, "YDes": zero, "YOut": np.where(turns > 0, -0.6, 0.0)}  # fmt: skip
    assert ("it spins against its control" in [one.title for one in made.find()]) is told


def test_a_heading_that_swings_against_its_control_does_not_spin() -> None:
    made = Made()
    swung = np.where(made.after(40.0, 46.0), 100.0 * np.sin(2 * np.pi * made.t), 0.0)
    zero = np.zeros_like(made.t)
    made.table["RATE"] = {"R": zero, "P": zero, "RDes": zero, "PDes": zero, "ROut": zero, "POut": zero,
                          "Y": swung, "YDes": zero + 200.0, "YOut": np.where(swung != 0, 0.5, 0.0)}  # fmt: skip
    assert "it spins against its control" not in [one.title for one in made.find()]


@pytest.mark.parametrize(("off_deg", "told"), [(25.0, True), (12.0, False)])
def test_what_goes_over_in_the_last_moment_of_the_log_is_out_of_control(off_deg: float, told: bool) -> None:
    made = Made()
    made.rows["ARM"] = made.rows["ARM"][:1]
    made.table["CTUN"]["ThO"][made.after(UP_S)] = HOVER
    for table in ("POS", "CTUN"):
        for field in ("RelHomeAlt", "Alt", "BAlt"):
            if field in made.table[table]:
                made.table[table][field][made.after(UP_S + 6)] = HEIGHT_M
    made.table["ATT"]["Roll"][made.after(END_S - 0.6)] += np.interp(
        made.t[made.after(END_S - 0.6)], [END_S - 0.6, END_S - 0.1], [2.0, off_deg]
    )
    assert ("it was out of control as the log ended" in [one.title for one in every_finding(made.find())]) is told


@pytest.mark.parametrize(
    ("firmware", "roll_deg", "felt", "told"),
    [
        ("ArduRover V4.5.4", 60.0, -9.8, True),
        ("ArduRover V4.5.4", 10.0, -9.8, False),  # a slope, or AHRS_TRIM
        ("ArduRover V4.5.4", 60.0, -20.0, False),  # what jolts feels more than gravity
        ("ArduCopter V4.5.4", 60.0, -9.8, False),  # in the air lift is all that it feels
    ],
)
def test_an_attitude_that_gravity_contradicts_is_wrong(firmware: str, roll_deg: float, felt: float, told: bool) -> None:
    made = Made()
    made.facts = {"firmware": firmware}
    made.table["ATT"]["Roll"][made.after(FAILS_S)] = roll_deg
    for number in ("", "#2"):
        made.table[f"IMU{number}"]["AccZ"][:] = felt
    assert ("the estimated attitude is wrong" in [one.title for one in every_finding(made.find())]) is told

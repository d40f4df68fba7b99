"""Runs that no profile fits are judged by what was flown or driven: what failed is said, never more than was seen."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin

from care_core.application.case import Request, open_case
from care_core.diagnose.judging import judge_plainly
from care_core.diagnose.verdict import status_of, verdict_of
from care_core.ecosystems.examine import examine
from care_core.ecosystems.measures import MISSION_KINDS, Mission
from care_core.ecosystems.registry import run_model
from care_core.errors import ExitCode
from care_core.logs import formats
from care_core.logs.base import Table
from care_core.logs.opening import open_log
from care_core.records import replace
from care_core.report.document import build_document
from care_core.report.html import to_html
from care_core.report.markdown import to_markdown
from care_core.report.terminal import to_text
from care_core.run import OutcomeCheck, Unavailable, Value, is_known
from tests.nav2_drive import recorded
from tests.rewritten import write_text
from tests.ros_drives import STATUS, Drive
from tests.ros_samples import write_bag
from tests.tables import TablesLog, read
from tests.unit.test_ardupilot_extract import HOME, KIND, METRES, flight, table
from tests.unit.test_px4_health import states

ROVER = {"firmware": "ArduRover V4.5.4", "vehicle": "rover"}
PLANE = {"firmware": "ArduPlane V4.4.0", "vehicle": "fixed wing"}
SUB = {"firmware": "ArduSub V4.1.0", "vehicle": "submarine"}
PX4 = MISSION_KINDS["px4_flight"]
SAMPLES = Path(__file__).parents[2] / "samples"


def checks(found: tuple[OutcomeCheck, ...]) -> dict[str, Value]:
    return {check.name: check.value for check in found}


def judged(facts: Mapping[str, str], mode: int, **replaced: Table | None) -> dict[str, Value]:
    """The checks of the flight of `test_ardupilot_extract`, taken for another vehicle's, in one mode."""
    tables = flight(MODE=table([(0.0, mode)], "ModeNum"), **replaced)
    (mission,) = KIND.missions(*read(tables, 75.0, facts=facts), {})
    return checks(KIND.outcome(mission))


def said(*texts: tuple[float, str]) -> Table:
    return table(list(texts), "Message")


def test_a_rover_that_completes_its_mission_is_fine_by_all_that_can_be_judged() -> None:
    found = judged(
        ROVER, 10, MSG=said((20.0, "Mission: 2 WP"), (30.0, "Reached waypoint #2"), (69.0, "Mission Complete"))
    )
    assert found == dict.fromkeys(
        ("armed", "moved", "mission_success", "no_crash", "no_failsafe", "disarmed"), 1.0
    )  # fmt: skip


def test_a_mission_that_the_vehicle_was_still_at_when_it_was_disarmed_failed() -> None:
    assert judged(ROVER, 10, MSG=said((20.0, "Mission: 2 WP")))["mission_success"] == 0.0


def test_a_mission_that_the_pilot_broke_off_is_no_failure_of_the_vehicle() -> None:
    modes = table([(0.0, 10), (40.0, 4)], "ModeNum")
    (mission,) = KIND.missions(*read(flight(MODE=modes, MSG=said((20.0, "Mission: 2 WP"))), 75.0, facts=ROVER), {})
    value = checks(KIND.outcome(mission))["mission_success"]
    assert isinstance(value, Unavailable)
    assert value.reason == "0 of 1 waypoints were reached, and the last mode was Hold"


def test_a_mission_that_a_failsafe_ended_failed() -> None:
    errors = table([(40.0, 17, 1)], "Subsys", "ECode")
    modes = table([(0.0, 10), (40.0, 4)], "ModeNum")
    (mission,) = KIND.missions(
        *read(flight(MODE=modes, ERR=errors, MSG=said((20.0, "Mission: 2 WP"))), 75.0, facts=ROVER), {}
    )
    assert checks(KIND.outcome(mission))["mission_success"] == 0.0


def test_a_rover_whose_log_stops_when_all_is_done_is_fine_and_one_on_its_way_is_not_known() -> None:
    armed = table([(10.0, 1, 0)], "ArmState", "Forced")
    assert "disarmed" not in judged(ROVER, 10, ARM=armed, MSG=said((69.0, "Mission Complete")))
    assert not is_known(judged(ROVER, 10, ARM=armed, MSG=said((20.0, "Mission: 2 WP")))["disarmed"])
    assert not is_known(judged(ROVER, 0, ARM=armed)["disarmed"])


def test_a_rover_that_stays_where_it_is_did_not_fail_by_it() -> None:
    at = np.arange(0.0, 75.0, 0.5)
    still = Table(
        at, {"Lat": np.full_like(at, HOME[0]), "Lng": HOME[1] + 0.5 * np.sin(at) / METRES, "RelHomeAlt": 0 * at}
    )
    assert not is_known(judged(ROVER, 0, POS=still)["moved"])


@pytest.mark.parametrize("facts", [ROVER, SUB])
def test_what_stays_on_the_ground_or_in_the_water_neither_takes_off_nor_lands(facts: Mapping[str, str]) -> None:
    assert {"took_off", "landed"}.isdisjoint(judged(facts, 0))


def test_a_plane_may_land_above_home() -> None:
    at = np.arange(0.0, 75.0, 0.5)
    level = np.zeros_like(at)
    hill = Table(at, {"Lat": level + HOME[0], "Lng": level + HOME[1], "RelHomeAlt": np.minimum(at, 30.0)})
    assert not is_known(judged(PLANE, 5, POS=hill)["landed"])
    assert judged(PLANE, 5)["landed"] == 1.0
    assert judged(PLANE, 10)["mission_success"] == 1.0


def test_a_failsafe_and_a_crash_are_faults_of_any_vehicle() -> None:
    found = judged(ROVER, 0, ERR=table([(50.0, 17, 1), (60.0, 12, 1)], "Subsys", "ECode"))
    assert (found["no_failsafe"], found["no_crash"]) == (0.0, 0.0)


@pytest.mark.parametrize(("facts", "mode", "is_fault"), [(PLANE, 5, True), (ROVER, 0, False)])
def test_a_forced_disarm_is_a_fault_of_what_can_fall(facts: Mapping[str, str], mode: int, *, is_fault: bool) -> None:
    found = judged(facts, mode, ARM=table([(10.0, 1, 0), (45.0, 0, 1)], "ArmState", "Forced"))
    assert (found["disarmed"] == 0.0) is is_fault


def test_a_refusal_is_a_fault_only_where_somebody_asked_to_arm() -> None:
    for text, value in (("Arm: Gyros inconsistent", 0.0), ("PreArm: Gyros inconsistent", None)):
        (mission,) = KIND.missions(*read(flight(ARM=None, MSG=said((2.0, text))), 75.0), {})
        (check,) = KIND.outcome(mission)
        assert check.value == value if value is not None else not is_known(check.value)


# --- PX4 ---------------------------------------------------------------------------------------------------------


def px4(**status: Any) -> dict[str, Value]:
    landed = status.pop("landed", [(0.0, 1), (12.0, 0), (49.5, 1)])
    result = status.pop("result", None)
    told_of_it = status.pop("mission", {})
    told = {"arming_state": [(0.0, 1), (10.0, 2), (50.0, 1)], "nav_state": [(0.0, 3)], "failsafe": [(0.0, 0)], **status}
    tables = {"vehicle_status": states(**told), "vehicle_land_detected": states(landed=landed)}
    if result is not None:
        tables["mission_result"] = states(finished=result, **told_of_it)
    (mission,) = PX4.missions(*read(tables, 60.0, formats.PX4_ULG), {})
    return checks(PX4.outcome(mission))


def test_a_px4_mission_that_was_finished_is_fine() -> None:
    found = px4(result=[(0.0, 0), (40.0, 1)])
    assert found == dict.fromkeys(
        ("armed", "took_off", "mission_success", "no_crash", "no_failsafe", "landed", "disarmed"), 1.0
    )
    assert not is_known(px4()["mission_success"])


def test_what_px4_says_of_take_off_and_return_is_nothing_of_a_mission() -> None:
    modes = [(0.0, 4), (10.0, 17), (20.0, 3), (30.0, 5)]
    for finished in ([(0.0, 0), (15.0, 1), (20.0, 0)], [(0.0, 0), (45.0, 1)]):
        assert not is_known(px4(nav_state=modes, result=finished)["mission_success"])


def test_a_px4_mission_whose_last_item_returned_and_landed_is_flown_whatever_mode_follows() -> None:
    modes = [(0.0, 3), (30.0, 5), (49.8, 3)]
    reached = {"seq_total": [(0.0, 4)], "seq_reached": [(0.0, -1), (20.0, 1), (29.0, 2), (49.8, -1)]}
    quiet = [(0.0, 0)]
    assert px4(nav_state=modes, result=quiet, mission=reached)["mission_success"] == 1.0
    early = {**reached, "seq_reached": [(0.0, -1), (20.0, 2)]}
    assert not is_known(px4(nav_state=modes, result=quiet, mission=early)["mission_success"])
    every = {**reached, "seq_reached": [(0.0, -1), (20.0, 3), (49.8, -1)]}
    assert px4(nav_state=[(0.0, 3)], result=quiet, mission=every)["mission_success"] == 1.0


@pytest.mark.parametrize("name", ["mission_id", "instance_count"])
def test_a_px4_mission_replaced_under_way_is_not_evaluated(name: str) -> None:
    finished, modes = [(0.0, 0), (40.0, 1)], [(0.0, 3), (45.0, 5)]
    replaced = px4(nav_state=modes, result=finished, mission={name: [(0.0, 7), (25.0, 8)]})["mission_success"]
    assert isinstance(replaced, Unavailable)
    assert replaced.reason == "the mission was replaced under way, at 25 s"
    for t in (5.0, 42.0, 48.0):  # before the flight, when all of it is done, on the way home
        assert px4(nav_state=modes, result=finished, mission={name: [(0.0, 7), (t, 8)]})["mission_success"] == 1.0
    log = TablesLog({"mission_result": states(**{name: [(0.0, 7), (25.0, 8)]})}, 60.0, formats.PX4_ULG)
    begun = {name: [(0.0, 7), (42.0, 8)], "seq_reached": [(0.0, -1), (44.0, 0)]}
    two = px4(nav_state=modes, result=[(0.0, 0), (40.0, 1), (42.0, 0)], mission=begun)["mission_success"]
    assert isinstance(two, Unavailable)
    timeline = examine(run_model(log)).timeline
    assert "another mission was uploaded" in [event.text for event in timeline]


def test_px4_says_what_failed() -> None:
    assert px4(failsafe=[(0.0, 0), (30.0, 1)])["no_failsafe"] == 0.0
    assert px4(failure_detector_status=[(0.0, 0), (30.0, 2)])["no_crash"] == 0.0
    assert not is_known(px4(nav_state=[(0.0, 2), (30.0, 13)])["no_crash"])  # terminated, at no height that is known
    assert px4(landed=[(0.0, 1), (12.0, 0)])["landed"] == 0.0
    assert not is_known(px4(landed=[(0.0, 1)])["took_off"])
    assert not is_known(px4(arming_state=[(0.0, 1), (10.0, 2)])["disarmed"])


def test_every_arming_of_a_px4_log_is_a_run() -> None:
    status = states(arming_state=[(0.0, 1), (10.0, 2), (20.0, 1), (30.0, 2)])
    spans = [
        (round(m.start_s, 3), round(m.end_s, 3), m.ended)
        for m in PX4.missions(*read({"vehicle_status": status}, 60.0, formats.PX4_ULG), {})
    ]
    assert spans == [(10.0, 20.0, True), (30.0, 60.0, False)]


# --- ROS ---------------------------------------------------------------------------------------------------------


def goals(*statuses: int | None) -> Value:
    kind = MISSION_KINDS["actionlib_goals"]
    count = len(statuses)
    sent = {
        "goal_id.id": np.array([f"g{i}" for i in range(count)], object),
        "goal.target_pose.header.frame_id": np.array(["map"] * count, object),
        **{f"goal.target_pose.pose.position.{axis}": 9.0 * np.arange(count) for axis in "xy"},
        **{f"goal.target_pose.pose.orientation.{axis}": np.zeros(count) + (axis == "w") for axis in "xyzw"},
    }
    answered = [i for i, status in enumerate(statuses) if status is not None]
    results = {
        "status.goal_id.id": np.array([f"g{i}" for i in answered], object),
        "status.status": np.array([statuses[i] for i in answered], float),
        "status.text": np.array([""] * len(answered), object),
    }
    tables = {
        "/move_base/goal": Table(np.linspace(0.0, 10.0 * (count - 1), count), sent),
        "/move_base/result": Table(10.0 * np.array(answered, float) + 8.0, results),
    }
    missions: tuple[Mission, ...] = kind.missions(*read(tables, 100.0, formats.ROS1_BAG), {"goal_timeout_s": 1e9})
    (check,) = kind.outcome(missions[-1])
    return check.value


def test_goals_reached_are_fine_failed_ones_a_fault_and_cancelled_ones_neither() -> None:
    assert goals(3, 3) == 1.0
    assert goals(3, 4) == 0.0
    assert goals(3, 2) == 1.0
    assert not is_known(goals(2))
    assert not is_known(goals(3, None))


def test_a_recorded_drive_is_judged_without_its_profile(tmp_path: Path) -> None:
    found = judge_plainly(run_model(open_log(recorded(tmp_path / "drive", StoragePlugin.MCAP))))
    assert found is not None
    assert [check.variable.name for check in found.checks] == ["goals_reached"]


def test_a_log_without_a_run_is_not_judged(tmp_path: Path) -> None:
    write_bag(tmp_path / "a.bag")
    assert judge_plainly(run_model(open_log(tmp_path / "a.bag"))) is None


# --- the whole -----------------------------------------------------------------------------------------------------


def test_what_a_run_came_to() -> None:
    assert status_of(["ok"], [], "no") == "not_evaluated"
    assert status_of(["ok"], ["warning"], "fits") == "ok"
    assert status_of(["ok", "not_evaluated"], [], "no") == "not_evaluated"
    assert status_of([], [], "no") == "not_evaluated"
    assert status_of(["ok"], ["critical"], "fits") == "fault"
    assert status_of(["ok", "fault"], [], "no") == "fault"


def test_a_failed_run_of_a_stranger_is_a_fault_without_causes_by_parameters(tmp_path: Path) -> None:
    path = write_text(tmp_path / "blimp.log", SAMPLES / "arducopter_failed.BIN")
    path.write_text(path.read_text().replace("ArduCopter V", "Blimp V"))
    diagnosis = open_case(Request(path), lambda _step, _share: None).diagnosis
    assert diagnosis.profile.fit.verdict == "no"
    assert {one.name for one in diagnosis.objectives} >= {"armed", "no_crash", "no_failsafe"}
    assert diagnosis.fix is None
    assert not any(one.what == "parameter" for one in diagnosis.hypotheses)
    assert "Causes of" not in to_text(diagnosis)
    good = tuple(replace(one, value=1.0, status="ok", reason="") for one in diagnosis.objectives)
    fine = replace(diagnosis, objectives=good, faults=(), health=replace(diagnosis.health, findings=()))
    assert verdict_of(fine).exit_code == ExitCode.NOT_EVALUATED
    for text in (to_text(fine), to_markdown(build_document(fine)), to_html(build_document(fine))):
        flat = " ".join(text.split())
        assert "No profile fits this log: no limits for time and energy, no causes by parameters" in flat
    bad = (replace(good[0], value=0.0, status="fault", reason="a failsafe acted"), *good[1:])
    failed = replace(fine, objectives=bad)
    assert verdict_of(failed).exit_code == ExitCode.FAULT
    assert "FAULT: a failsafe acted" in to_text(failed)
    assert "**FAULT**: a failsafe acted" in to_markdown(build_document(failed))


def test_of_a_drive_whose_task_is_not_recorded_it_is_said_that_checks_found_nothing(tmp_path: Path) -> None:
    class Aimless(Drive):
        def messages(self) -> Iterator[tuple[str, str, float, Any]]:
            yield from (one for one in super().messages() if one[1] != STATUS)

    path = Aimless().write(tmp_path / "drive.mcap")
    text = to_text(open_case(Request(path), lambda _step, _share: None).diagnosis)
    assert "NOT EVALUATED: neither goals nor messages of nodes are recorded" in " ".join(text.split())
    assert "Findings: no health problems found in what this log records" in text

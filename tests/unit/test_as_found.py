"""Objectives follow the findings: no crash is OK, and no landing, where the log shows a crash."""

from __future__ import annotations

import pytest

from care_core.diagnose.as_found import as_found
from care_core.ecosystems.findings import CAME_DOWN, Finding, FindingKind
from care_core.records import replace
from care_core.run import MissionInfo, OutcomeCheck, Run, Unavailable, Value
from tests.made import made_run

CRASH = Finding("crash", "it crashed", 100.0, 100.0, "critical", "", "")
CHECKS = (
    OutcomeCheck("took_off", 1.0, "it left the ground"),
    OutcomeCheck("mission_success", 1.0, "every waypoint was reached"),
    OutcomeCheck("no_crash", 1.0, "the autopilot reported no crash"),
    OutcomeCheck("landed", 1.0, "it was on the ground at the end"),
)


def flown(**changed: object) -> Run:
    return replace(made_run(), checks=CHECKS, objectives={"success": 1.0}, shortfall=(), **changed)


def values(run: Run) -> dict[str, Value]:
    return {check.name: check.value for check in run.checks}


@pytest.mark.parametrize("kind", ["crash", "takeoff"])
def test_a_crash_that_the_log_shows_counts_as_one_whatever_the_autopilot_reports(kind: FindingKind) -> None:
    found = as_found(flown(), [replace(CRASH, kind=kind)], ("success",))
    assert values(found) == {
        "took_off": 1.0, "mission_success": 0.0, "no_crash": 0.0, "landed": Unavailable("it crashed"),
    }  # fmt: skip
    assert found.objectives == {"success": 0.0}
    assert found.shortfall == ("it crashed at 100.0 s (1:40)",)
    assert [check.otherwise for check in found.checks if check.value == 0.0] == ["it crashed at 100.0 s (1:40)"] * 2


def test_a_crash_of_a_flight_that_was_recorded_in_part_is_one() -> None:
    partly = Unavailable("the flight was recorded for 56 of 116 s")
    run = replace(flown(), checks=(OutcomeCheck("no_crash", partly, "none was reported"),))
    assert values(as_found(run, [CRASH])) == {"no_crash": 0.0}


def test_one_that_is_folded_under_its_cause_counts_too() -> None:
    motor = Finding("motor", "motor 2 lost thrust", 98.0, 99.0, "critical", "", "", consequences=(CRASH,))
    assert values(as_found(flown(), [motor]))["no_crash"] == 0.0
    followed = replace(motor, consequences=(), followed_by=(replace(CRASH, title=CAME_DOWN),))
    assert values(as_found(flown(), [followed]))["landed"] == Unavailable(CAME_DOWN)


@pytest.mark.parametrize(
    "other",
    [replace(CRASH, severity="warning"), replace(CRASH, kind="attitude"), replace(CRASH, onset_s=197.0)],
    ids=["no sure crash", "control that was lost", "in another flight"],
)
def test_nothing_else_changes_the_objectives(other: Finding) -> None:
    run = flown()
    assert as_found(run, [other]) is run


def test_a_robot_that_hit_something_may_reach_its_goals() -> None:
    run = flown()
    drive = replace(run, log=replace(run.log, format="mcap"))
    assert as_found(drive, [CRASH], ("success",)) is drive


def test_a_crash_decides_a_mission_whose_end_the_log_does_not_hold() -> None:
    run = flown()
    cut = replace(run, mission=replace(run.mission, ended=False))
    assert isinstance(cut.mission, MissionInfo)
    assert as_found(cut, [CRASH]).mission.ended


def test_how_it_failed_tells_the_crash_behind_what_was_not_reached_and_once() -> None:
    short = flown()
    found = as_found(replace(short, shortfall=("1 of 3 waypoints were reached", "disarmed by force")), [CRASH])
    assert found.shortfall == ("1 of 3 waypoints were reached", "it crashed at 100.0 s (1:40)", "disarmed by force")
    told = replace(short, shortfall=("crash detected at 99.0 s",))
    assert as_found(told, [CRASH]).shortfall == told.shortfall

"""The robots of the published tables read bags, say where what they know comes from, and judge no limit unasked."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from care_core.ecosystems.measures import Mission, find_extractor
from care_core.extract.coverage import cover
from care_core.extract.fit import fit_of
from care_core.extract.select import choose_profile, sound_profiles
from care_core.logs.base import Table
from care_core.logs.opening import open_log
from care_core.profile.store import load_profile
from care_core.records import replace
from care_core.run import Unavailable
from tests.conftest import Care
from tests.tables import no_model

PUBLISHED = ("husky", "husky-care", "turtlebot3")
FAILED = "data/move_base/faults/g55_007.bag"
T = np.arange(4.0)


def scan(ranges: list[list[float]]) -> Mission:
    column = np.empty(len(ranges), dtype=object)
    column[:] = [np.array(one) for one in ranges]
    limits = {"range_min": np.full(len(ranges), 0.1), "range_max": np.full(len(ranges), 10.0)}
    return Mission(no_model(), {"/scan": Table(T[: len(ranges)], {"ranges": column, **limits})}, 0.0, 2.0, True, {})


def test_the_nearest_obstacle_is_the_shortest_ray_that_the_scanner_can_see() -> None:
    rays = [[5.0, np.inf, 2.0], [0.01, 3.0, np.nan], [1.5, 12.0, 4.0], [0.2, 0.2, 0.2]]
    assert find_extractor("obstacle_distance").compute(scan(rays), {}) == 1.5  # the last is after the mission
    assert isinstance(find_extractor("obstacle_distance").compute(scan([[np.inf]]), {}), Unavailable)


@pytest.mark.parametrize("name", PUBLISHED)
def test_a_published_robot_names_what_a_bag_cannot_tell(name: str) -> None:
    profile = load_profile(name)
    unread = {v.name for v in profile.schema.variables.values() if v.extract is None} - {
        option.name for option in profile.schema.options
    }
    assert unread == (set() if name == "husky-care" else {"Energy"})
    card = (profile.path / "MODEL_CARD.md").read_text()
    assert profile.schema.learned_elsewhere in card
    assert all(variable in card.partition("No log can tell: ")[2] for variable in unread)


@pytest.mark.parametrize("name", ["husky", "husky-care"])
def test_a_bag_is_triaged_and_never_with_more_than_low_confidence(care: Care, recorded: Path, name: str) -> None:
    answer = care("triage", recorded / FAILED, "--profile", name, "--json")
    assert answer.code == 1
    report = json.loads(answer.stdout)
    assert report["fit"]["verdict"] == "partly"
    assert any("published table" in reason for reason in report["fit"]["reasons"])
    options = load_profile(name).schema.options
    assert len(report["config"]) == len(options)
    causes = [cause for fault in report["faults"] for cause in fault["causes"]]
    assert causes
    assert {cause["confidence"] for cause in causes} == {"low"}
    assert report["fix"] is None
    judged = {one["name"]: one["status"] for one in report["objectives"]}
    assert [name for name, status in judged.items() if status == "fault"] == [
        "Mission_success" if name == "husky-care" else "Task_success_rate"
    ]


def test_the_limits_of_other_missions_are_judged_only_where_given(care: Care, recorded: Path) -> None:
    good = recorded / "data/move_base/faults/g55_002.bag"
    unasked = json.loads(care("triage", good, "--profile", "husky-care", "--json").stdout)
    battery = next(one for one in unasked["objectives"] if one["name"] == "Battery_percentage")
    assert battery["status"] == "not_evaluated"
    assert "published table" in battery["reason"]
    asked = json.loads(
        care("triage", good, "--profile", "husky-care", "--json", "--threshold", "Battery_percentage=99").stdout
    )
    battery = next(one for one in asked["objectives"] if one["name"] == "Battery_percentage")
    assert battery["status"] == "fault"


def test_what_was_learned_from_such_logs_comes_first(recorded: Path) -> None:
    log = open_log(recorded / FAILED)
    profile, choice = choose_profile(log, sound_profiles()[0])
    assert profile is not None
    assert profile.schema.name == "move_base"
    assert "husky" not in choice.reason
    carried = replace(profile.schema, carried_over="elsewhere")
    assert fit_of(log, cover(log, carried)).verdict == "partly"


def test_a_profile_carried_to_its_own_robot_is_carried_over_no_more() -> None:
    from care_core.application.training import _retargeted

    text = (load_profile("husky-care").path / "profile.yaml").read_text()
    assert "carried_over:" in text
    assert "carried_over:" not in _retargeted(text, "mine", "runs.csv", ())

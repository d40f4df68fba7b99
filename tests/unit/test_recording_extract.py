"""The recording as a mission, and extractors of any number of any channel."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from care_core.ecosystems.measures import MISSION_KINDS, Args, Mission, find_extractor
from care_core.ecosystems.whole_log import KIND
from care_core.extract.read import reading_plan
from care_core.logs.base import Table
from care_core.logs.formats import PX4_ULG
from care_core.profile.schema import Schema
from care_core.run import Unavailable
from care_core.variables import Extract, Role, Variable
from tests.tables import no_model, read

T = np.arange(10.0)
ARMED = {"channel": "status", "field": "armed", "value": 2}


def missions(armed: list[float], spec: Args) -> tuple[Mission, ...]:
    return MISSION_KINDS[KIND].missions(*read({"status": Table(T, {"armed": np.array(armed)})}, 9.5), spec)


def test_the_whole_recording_is_one_mission() -> None:
    (mission,) = missions([0.0] * 10, {})
    assert (mission.start_s, mission.end_s, mission.ended) == (0.0, 9.5, True)


def test_each_stretch_of_the_value_is_a_mission_and_the_last_goes_on() -> None:
    first, last = missions([1, 2, 2, 1, 1, 2, 2, 2, 2, 2], ARMED)
    assert (first.start_s, first.end_s, first.ended) == (1.0, 3.0, True)
    assert (last.start_s, last.end_s, last.ended) == (5.0, 9.5, False)


def test_a_log_without_the_channel_has_no_mission() -> None:
    assert MISSION_KINDS[KIND].missions(*read({}, 9.5), ARMED) == ()
    assert missions([1.0] * 10, {**ARMED, "field": "absent"}) == ()


def value(columns: dict[str, Any], **args: str) -> float | Unavailable | None:
    mission = Mission(no_model(), {"/speed": Table(T, columns)}, 2.0, 5.0, True, {})
    return find_extractor("signal").compute(mission, {"channel": "/speed", "field": "data", **args})


@pytest.mark.parametrize(
    ("stat", "expected"),
    [("mean", 3.5), ("min", 2.0), ("max", 5.0), ("first", 2.0), ("last", 5.0), ("change", 3.0),
     ("std", math.sqrt(1.25)), ("rms", math.sqrt(13.5))],
)  # fmt: skip
def test_a_signal_is_a_statistic_of_what_was_said_during_the_mission(stat: str, expected: float) -> None:
    assert value({"data": T}, stat=stat) == pytest.approx(expected)


def test_what_is_no_number_is_left_out_or_unavailable() -> None:
    assert value({"data": np.where(T == 3.0, np.nan, T)}, stat="max") == 5.0
    assert isinstance(value({"data": np.full(10, np.nan)}), Unavailable)
    assert isinstance(value({"data": np.array(["x"] * 10, dtype=object)}), Unavailable)
    assert isinstance(value({"other": T}), Unavailable)


@pytest.mark.parametrize(("failsafe", "expected"), [(0.0, 1.0), (1.0, 0.0)])
def test_the_outcome_is_the_word_of_the_robot(failsafe: float, expected: float) -> None:
    status = {"arming_state": np.where((T > 0) & (T < 8), 2.0, 1.0), "failsafe": np.where(T == 4, failsafe, 0.0)}
    landed = Table(T, {"landed": np.where((T > 1) & (T < 7), 0.0, 1.0)})
    tables = {"vehicle_status": Table(T, status), "vehicle_land_detected": landed}
    (mission,) = MISSION_KINDS["px4_flight"].missions(*read(tables, 9.0, PX4_ULG), {"kind": "px4_flight"})
    assert find_extractor("outcome").compute(mission, {}) == expected
    assert isinstance(find_extractor("outcome").compute(Mission(no_model(), {}, 0, 9, True, {}), {}), Unavailable)


def test_a_profile_reads_what_its_signals_name() -> None:
    speed = Variable("speed", Role.METRIC, extract=Extract("signal", {"channel": "/speed", "field": "data"}))
    schema = Schema("s", "", "", "", {}, ("mcap",), False, {"kind": KIND, **ARMED}, (), {"speed": speed})
    assert reading_plan(schema) == {"status": ("armed",), "/speed": ("data",)}

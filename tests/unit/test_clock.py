"""Impossible time stamps against clocks that were set, and pauses."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from care_core.logs.clock import OwnClock, VehicleTime, clock_of, find_clock, vehicle_time
from care_core.numbers import Floats
from tests.whole import examples


def places(n: int) -> NDArray[np.int64]:
    return np.arange(n, dtype=np.int64) * 40


def seconds(n: int, since: float = 0.0, step: float = 1.0) -> Floats:
    return np.asarray(since + np.arange(n) * step, dtype=np.float64)


def test_a_sound_log_is_left_alone() -> None:
    stamps = seconds(100, 5.0, 0.1)
    clock, impossible, jumps = find_clock(stamps, places(100))
    assert not impossible.any()
    assert jumps == []
    np.testing.assert_allclose(clock.seconds(stamps, places(100)), stamps - 5.0)
    assert clock.duration_s == pytest.approx(9.9)


@pytest.mark.parametrize("wrong", [0.0, 1e13, -4.0, 500.0, np.nan])
@pytest.mark.parametrize("at", [0, 1, 50, 98, 99])
def test_a_single_wrong_stamp_is_found(wrong: float, at: int) -> None:
    stamps = seconds(100, 100.0, 0.1)
    stamps[at] = wrong
    clock, impossible, jumps = find_clock(stamps, places(100))
    if (at == 0 and abs(wrong) < 10) or (at == 99 and wrong == 500.0):
        return  # a first or last record beyond a pause cannot be told from one with a flipped bit
    assert np.flatnonzero(impossible).tolist() == [at]
    assert jumps == []
    assert clock.duration_s == pytest.approx(9.9, abs=0.2)


def test_a_restarted_clock_goes_on() -> None:
    stamps = np.concatenate((seconds(50, 10), seconds(50)))
    clock, impossible, jumps = find_clock(stamps, places(100))
    assert not impossible.any()
    assert [(one.what, one.byte) for one in jumps] == [("the clock of the log jumps by -59 s", 2000)]
    assert (np.diff(clock.seconds(stamps, places(100))) >= 0).all()


@pytest.mark.parametrize(
    ("went_s", "jumps"),
    [
        (1.0, ["the clock of the log jumps by +3550 s"]),  # it was set
        (3551.0, []),  # nothing was recorded
        (-20.0, []),  # the robot was started again: nobody knows
    ],
)
def test_a_step_forward_is_a_pause_where_the_robots_own_clock_made_it(went_s: float, jumps: list[str]) -> None:
    stamps = np.concatenate((seconds(50), seconds(50, 3600)))
    own = np.concatenate((seconds(50, 7), seconds(50, 56 + went_s)))
    clock, _, found = find_clock(stamps, places(100), OwnClock(places(100), own, stamps))
    assert [one.what for one in found] == jumps
    assert clock.duration_s == (99.0 if jumps else 3649.0)


def test_what_a_link_held_up_and_sent_at_once_sets_no_clock() -> None:
    stamps = np.concatenate((seconds(30), np.full(30, 60.0), seconds(40, 60)))
    _, _, jumps = find_clock(stamps, places(100), OwnClock(places(100), seconds(100, 7), stamps))
    assert jumps == []


def test_a_pause_of_an_hour_is_no_damage_and_a_jump_of_years_is() -> None:
    stamps = np.concatenate((seconds(50), seconds(50, 3600)))
    clock, impossible, jumps = find_clock(stamps, places(100))
    assert not impossible.any()
    assert jumps == []
    assert clock.duration_s == 3649.0
    stamps[50:] += 1e8
    clock, impossible, jumps = find_clock(stamps, places(100))
    assert not impossible.any()
    assert len(jumps) == 1
    assert clock.duration_s < 200


@settings(deadline=None)
@given(st.lists(st.floats(allow_nan=True, allow_infinity=True), max_size=60))
def test_any_stamps_give_a_clock(stamps: list[float]) -> None:
    clock, impossible, _ = find_clock(np.array(stamps), places(len(stamps)))
    assert len(impossible) == len(stamps)
    assert clock.duration_s >= 0


@settings(deadline=None, max_examples=examples(50))
@given(st.lists(st.sampled_from([0.0, 0.1, 1.0, 7.0, -2.0, -90.0, 1e6, 1e13, np.nan]), max_size=80), st.integers(1, 9))
def test_a_clock_found_piece_by_piece_is_the_same(steps: list[float], size: int) -> None:
    stamps = 50.0 + np.cumsum(np.nan_to_num(steps))
    stamps[np.isnan(steps)] = np.nan
    at = places(len(stamps))
    whole, impossible, jumps = find_clock(stamps, at)
    clock, spans, found = clock_of((stamps[low : low + size], at[low : low + size]) for low in range(0, len(at), size))
    assert (clock.first_s, clock.last_s, found) == (whole.first_s, whole.last_s, jumps)
    np.testing.assert_array_equal(clock.places, whole.places)
    lost = {place for first, last in spans for place in at.tolist() if first <= place <= last}
    assert lost == set(at[impossible].tolist())


def heard(own_s: Floats, station_s: Floats) -> VehicleTime | None:
    """The vehicle's time of records of 50 bytes that a station stamped so."""
    places = np.arange(len(own_s), dtype=np.int64) * 50
    clock, _, _ = find_clock(station_s, places)
    return vehicle_time(OwnClock(places, own_s, station_s), clock)


@pytest.mark.parametrize("pace", [0.0, 0.12, 0.6, 1.5, 20.0])
def test_a_clock_that_runs_wrong_gives_way_to_the_vehicles_own_time(pace: float) -> None:
    own_s = 30.0 + np.arange(0.0, 120.0, 0.25)
    found = heard(own_s, 1.6e9 + pace * own_s)
    assert found is not None
    assert found.duration_s == pytest.approx(own_s[-1] - own_s[0])
    assert found.at(np.array([50, 75])) == pytest.approx([0.25, 0.375])
    assert pace == 0.0 or found.pace == pytest.approx(1 / pace, rel=0.05)


@pytest.mark.parametrize("late_s", [0.0, 3.0, 9.0])
def test_what_waits_for_a_link_now_and_then_keeps_the_stations_clock(late_s: float) -> None:
    own_s = np.arange(0.0, 600.0, 0.25)
    waits = (own_s > 200.0) & (own_s < 200.0 + late_s)
    assert heard(own_s, 1.6e9 + np.where(waits, 200.0 + late_s, own_s)) is None


def test_a_vehicle_that_starts_again_has_one_time_that_goes_on() -> None:
    own_s = np.concatenate([np.arange(0.0, 60.0, 0.25), np.arange(2.0, 60.0, 0.25)])
    assert heard(own_s, seconds(len(own_s), 1.6e9, 0.25)) is None
    found = heard(own_s, seconds(len(own_s), 1.6e9, 2.5))
    assert found is not None
    assert np.all(np.diff(found.seconds) >= 0.0)
    assert found.duration_s == pytest.approx(len(own_s) * 0.25, abs=1.0)

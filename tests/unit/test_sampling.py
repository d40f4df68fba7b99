"""Plans of campaigns: inside ranges and limits whatever is asked, the same for the same seed, repeats among them."""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from care_core.collect.sampling import Method, new_among, one_at_a_time, points, with_repeats
from care_core.collect.space import Axis, Space
from care_core.constraints import parse_constraint
from care_core.errors import UsageError
from care_core.variables import Role, Variable
from tests.campaigns import space
from tests.whole import examples

METHODS: tuple[Method, ...] = ("sobol", "latin_hypercube", "uniform")
TWO = {"a": (0.0, 1.0), "b": (-3.0, 5.0)}

pytest.importorskip("scipy")


@st.composite
def axes(draw: Any, number: int) -> Axis:
    kind = draw(st.sampled_from(("float", "int", "bool", "enum")))
    if kind == "bool":
        return Axis(Variable(f"o{number}", Role.OPTION, "bool"), 0.0, 1.0)
    if kind == "enum":
        codes = draw(st.lists(st.integers(-5, 20), min_size=2, max_size=4, unique=True))
        labels = tuple((float(code), f"code {code}") for code in codes)
        return Axis(Variable(f"o{number}", Role.OPTION, "enum", labels=labels), float(min(codes)), float(max(codes)))
    if kind == "int":
        low = draw(st.integers(-1000, 1000))
        high = low + draw(st.integers(1, 5000))
        return Axis(Variable(f"o{number}", Role.OPTION, "int", range=(low, high)), float(low), float(high))
    low = draw(st.floats(-1e6, 1e6).filter(lambda value: value == 0 or abs(value) > 1e-6))
    high = low + draw(st.floats(1e-3, 1e6)) * max(1.0, abs(low))
    return Axis(Variable(f"o{number}", Role.OPTION, "float", range=(low, high)), low, high)


@st.composite
def spaces(draw: Any) -> Space:
    made = [draw(axes(number)) for number in range(draw(st.integers(1, 5)))]
    reference = {axis.name: axis.at(draw(st.floats(0, 1))) for axis in made}
    first = made[0]
    middle = (first.low + first.high) / 2
    text = f"{first.name} {'<=' if reference[first.name] <= middle else '>='} {middle!r}"
    limits = [text] if draw(st.booleans()) else []
    if len(made) > 1:
        total = reference[made[0].name] + reference[made[1].name]
        limits.append(f"{made[0].name} + {made[1].name} <= {total + draw(st.floats(0.1, 100))!r}")
    return Space(made, reference, [parse_constraint(one, reference) for one in limits])


@settings(max_examples=examples(60))
@given(spaces(), st.sampled_from((*METHODS, "one_at_a_time")), st.floats(0, 0.9), st.integers(0, 1000))
def test_no_sample_crosses_a_range_or_a_limit(where: Space, method: Any, at_reference: float, seed: int) -> None:
    try:
        found = one_at_a_time(where, 12) if method == "one_at_a_time" else points(where, method, 12, at_reference, seed)
    except UsageError:  # a space of a few codes does not hold twelve
        return
    for config in found:
        for axis in where.axes:
            value = float(f"{config[axis.name]:.6g}")  # as a file holds it
            assert axis.low <= value <= axis.high
            assert axis.option.type != "int" or value == round(value)
            assert axis.values is None or value in axis.values
        assert where.allows(config)


@pytest.mark.parametrize("method", METHODS)
def test_the_same_seed_gives_the_same_plan(method: Method) -> None:
    where = space(TWO, "a + b <= 4")
    assert points(where, method, 20, 0.3, 7) == points(where, method, 20, 0.3, 7)
    assert points(where, method, 20, 0.3, 7) != points(where, method, 20, 0.3, 8)


@pytest.mark.parametrize("method", METHODS)
def test_a_share_stays_at_the_reference(method: Method) -> None:
    where = space(dict.fromkeys("abcdefgh", (0.0, 1.0)))
    found = points(where, method, 256, 0.75, 1)
    kept = np.mean([[config[name] == 0.5 for name in "abcdefgh"] for config in found])
    assert 0.64 < kept < 0.78  # none of them is the reference itself
    assert len({tuple(config.values()) for config in found}) == 256
    assert not any(all(value == 0.5 for value in config.values()) for config in found)


@pytest.mark.parametrize("method", METHODS)
def test_runs_leave_the_reference_in_few_options_and_in_many(method: Method) -> None:
    names = [f"o{i}" for i in range(20)]
    where = space(dict.fromkeys(names, (0.0, 1.0)))
    left = {
        alike: [
            sum(config[name] != 0.5 for name in names) for config in points(where, method, 256, 0.6, 1, alike=alike)
        ]
        for alike in (True, False)
    }
    assert np.mean(left[True]) == pytest.approx(8, abs=0.5)
    assert np.mean(left[False]) == pytest.approx(8, abs=0.8)  # none is the reference itself
    assert np.mean(np.array(left[True]) <= 3) < 0.05
    assert np.mean(np.array(left[False]) <= 3) > 0.12
    assert np.mean(np.array(left[False]) >= 13) > 0.12


def test_sobol_points_cover_a_range_more_evenly_than_chance() -> None:
    where = space(TWO)
    spread = [sorted(config["a"] for config in points(where, "sobol", 64, 0.0, seed)) for seed in range(5)]
    largest_gap = max(max(np.diff(values)) for values in spread)
    assert largest_gap < 0.05  # 64 random numbers leave a gap of about 0.07


def test_one_at_a_time_changes_one_option_and_begins_with_the_ends() -> None:
    found = one_at_a_time(space({"a": (0.0, 1.0), "b": (1.0, 4.0)}, kinds={"b": "int"}), 9)
    assert found[:4] == [{"a": 1, "b": 3}, {"a": 0.5, "b": 4}, {"a": 0, "b": 3}, {"a": 0.5, "b": 1}]
    assert all((config["a"] != 0.5) + (config["b"] != 3) == 1 for config in found)
    assert len({tuple(config.values()) for config in found}) == 9


def test_repeats_are_spread_and_the_reference_comes_first() -> None:
    where = space(TWO)
    configs = points(where, "sobol", new_among(20, 0.2), 0.0, 1)
    plan = with_repeats(where, configs, 20, 0.2, 3)
    assert [run.number for run in plan] == list(range(1, 21))
    assert plan[0].config == where.reference
    assert {run.number: run.repeats for run in plan if run.repeats} == {5: 1, 10: 2, 15: 3, 20: 4}
    assert all(run.config == plan[run.repeats - 1].config for run in plan if run.repeats)
    again = {run.number: run.repeats for run in plan if run.repeats and run.seed == plan[run.repeats - 1].seed}
    assert again == {10: 2, 20: 4}  # every other one meets the conditions of the run that it repeats
    assert len({run.seed for run in plan}) == 18


def test_the_reference_is_driven_again_under_conditions_of_its_own() -> None:
    where = space(TWO)
    configs = points(where, "sobol", new_among(20, 0.2, 0.1), 0.0, 1)
    plan = with_repeats(where, configs, 20, 0.2, 3, 0.1)
    assert len(plan) == 20
    assert {run.number: run.repeats for run in plan if run.repeats} == {5: 1, 9: 1, 10: 2, 15: 3, 19: 1, 20: 4}
    assert all(plan[n - 1].config == where.reference for n in (1, 5, 9, 19))
    assert len({run.seed for run in plan}) == 18


def test_limits_that_leave_nothing_are_said() -> None:
    with pytest.raises(UsageError, match=r"Only 0 of 5 configurations .* keep all limits"):
        points(space(TWO, "a >= 0.5", "a <= 0.5", "b >= 1", "b <= 1"), "uniform", 5, 0.0, 1)


def test_a_reference_outside_the_limits_is_refused() -> None:
    with pytest.raises(UsageError, match=r"reference breaks the limit 'a \+ b <= 1'"):
        space(TWO, "a + b <= 1")


@pytest.mark.parametrize(
    "text",
    ["a", "a == 1", "a <= open('x')", "a <= b.real", "a if b else a", "a <= (lambda: 1)()", "a <= [1][0]", "a < 'x'",
     "a <= 2 ** 9", "a <= 1 and b <= 1", "a <=", "", "a <= True", "(" * 300 + "a", "a <= 1j"],
)  # fmt: skip
def test_what_is_no_inequality_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match="is not a limit"):
        parse_constraint(text, {"a": 0, "b": 0})


def test_limits_are_computed() -> None:
    known = {"speed": 0.0, "time": 0.0}
    limit = parse_constraint("0 < -(-speed) * time / 2 <= 1.5 - 0.5", known)
    assert limit.holds({"speed": 1.0, "time": 2.0})
    assert not limit.holds({"speed": 1.0, "time": 2.1})
    assert not limit.holds({"speed": 0.0, "time": 2.0})
    assert not parse_constraint("1 / speed <= 9", known).holds({"speed": 0.0, "time": 1.0})
    assert not parse_constraint("speed <= 9", known).holds({"speed": math.nan, "time": 1.0})
    with pytest.raises(UsageError, match=r"'sped', which is not a parameter.*Did you mean 'speed'"):
        parse_constraint("sped <= 1", known)


def test_without_scipy_planning_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "scipy.stats", None)
    with pytest.raises(UsageError, match=r"Planning a campaign needs scipy.*care-tui\[learn\]"):
        points(space(TWO), "sobol", 4, 0.0, 1)

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_core.causal.effects import Direction, acceptable_values, along, average_causal_effect
from care_core.variables import Role, Variable

responses = st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=12)


@given(responses, st.floats(0.1, 100))
def test_magnitude_is_the_mean_over_ordered_pairs(response: list[float], scale: float) -> None:
    expected = np.mean([abs(a - b) for a, b in permutations(response, 2)]) / scale
    assert average_causal_effect(response, scale).magnitude == pytest.approx(expected, abs=1e-6)


@given(responses, st.floats(-100, 100))
def test_an_offset_changes_nothing_and_a_factor_scales(response: list[float], offset: float) -> None:
    effect = average_causal_effect(response, 1.0)
    assert average_causal_effect(np.add(response, offset), 1.0).magnitude == pytest.approx(effect.magnitude, abs=1e-6)
    assert average_causal_effect(np.multiply(response, 2), 2.0).magnitude == pytest.approx(effect.magnitude)


@pytest.mark.parametrize(
    ("response", "direction"),
    [
        ([0, 1, 2, 3], "increasing"),
        ([3, 2.9, 1, 0], "decreasing"),
        ([0, 1.1, 1, 2], "increasing"),
        ([0, 2, 3, 1], "optimum inside"),
        ([0, 10, 7], "optimum inside"),
        ([0, 10, 8], "increasing"),
        ([3, 0, 0, 3], "optimum inside"),
        ([1, 1, 1, 1], "none"),
        ([1], "none"),
    ],
)
def test_direction(response: list[float], direction: str) -> None:
    assert average_causal_effect(response, 1.0).direction == direction


def test_a_variable_without_variation_is_moved_by_nothing() -> None:
    assert average_causal_effect([0, 1], 0.0).magnitude == 0.0


@pytest.mark.parametrize(("response", "scale"), [([], 1.0), ([1, np.nan], 1.0), ([1, 2], -1.0), ([1, 2], np.nan)])
def test_what_is_not_a_response_is_refused(response: list[float], scale: float) -> None:
    with pytest.raises(ValueError, match=r"response|scale"):
        average_causal_effect(response, scale)


def option(**fields: object) -> Variable:
    return Variable("v", Role.OPTION, **fields)  # type: ignore[arg-type]


def test_options_are_spread_over_their_range() -> None:
    assert acceptable_values(option(range=(0.0, 4.0)), [], count=5).tolist() == [0, 1, 2, 3, 4]
    assert acceptable_values(option(range=(0.01, 1.0)), [], count=3).tolist() == pytest.approx([0.01, 0.1, 1.0])


def test_types_are_respected() -> None:
    assert acceptable_values(option(type="int", range=(1.0, 4.0)), []).tolist() == [1, 2, 3, 4]
    assert acceptable_values(option(type="bool"), []).tolist() == [0, 1]
    assert acceptable_values(option(type="enum", labels=((2.0, "b"), (0.0, "a"))), []).tolist() == [0, 2]


def test_without_a_range_the_observed_values_count() -> None:
    metric = Variable("m", Role.METRIC)
    observed = np.r_[np.linspace(0, 1, 99), np.nan, 1e6]
    values = acceptable_values(metric, observed)
    assert len(values) == 9
    assert values.max() < 2
    assert acceptable_values(metric, [3, 1, 3, np.nan]).tolist() == [1, 3]


@pytest.mark.parametrize(
    ("edges", "path"),
    [
        (("increasing", "increasing"), "increasing"),
        (("increasing", "decreasing"), "decreasing"),
        (("decreasing", "decreasing"), "increasing"),
        (("decreasing", "optimum inside"), "optimum inside"),
        (("optimum inside", "none"), "none"),
    ],
)
def test_signs_multiply_along_a_path(edges: tuple[Direction, ...], path: Direction) -> None:
    assert along(edges) == path

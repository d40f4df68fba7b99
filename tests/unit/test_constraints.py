from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_core.learn.constraints import Constraints
from care_core.records import replace
from care_core.variables import Role
from tests.simulated import schema_of

O, C, M, Y = Role.OPTION, Role.CONTEXT, Role.METRIC, Role.OBJECTIVE  # noqa: E741
ROLES = {"o": O, "p": O, "c": C, "d": C, "m": M, "n": M, "y": Y, "z": Y}
PLACES = st.fixed_dictionaries({name: st.none() | st.integers(0, 3) for name in ROLES})


@pytest.mark.parametrize("edge", ["op", "mo", "yo", "oc", "cd", "mc", "yc", "ym", "oy", "co"])
def test_what_randomised_options_rule_out(edge: str) -> None:
    rules = Constraints(ROLES)
    assert rules.forbids(*edge)
    assert rules.reason(*edge)


@pytest.mark.parametrize("edge", ["om", "cm", "cy", "mn", "nm", "my", "yz", "zy"])
def test_what_may_be(edge: str) -> None:
    assert Constraints(ROLES).reason(*edge) is None


def test_contexts_cause_options_only_where_operators_chose_them() -> None:
    assert not Constraints(ROLES, observational=True).forbids("c", "o")
    assert Constraints(ROLES).is_exogenous("o")
    assert not Constraints(ROLES, observational=True).is_exogenous("o")
    assert Constraints(ROLES, observational=True).is_exogenous("c")


@pytest.mark.parametrize("pair", [("m", "n"), ("y", "z")])
def test_the_later_never_causes_the_earlier(pair: tuple[str, str]) -> None:
    early, late = pair
    rules = Constraints(ROLES, order={early: 1, late: 2})
    assert rules.forbids(late, early)
    assert rules.never_causes(late, early)
    assert not rules.forbids(early, late)
    assert "order" in (rules.reason(late, early) or "")


def test_a_number_made_of_others_is_not_caused_by_what_comes_after_it() -> None:
    assert Constraints(ROLES, order={"m": 2, "y": 1}).forbids("m", "y")
    assert not Constraints(ROLES, order={"m": 1, "y": 2}).forbids("m", "y")


@pytest.mark.parametrize("order", [{"m": 1, "n": 1}, {"m": 1}, {"n": 1}, {"m": None, "n": 1}, {}])
def test_what_has_no_place_or_the_same_may_cause_either_way(order: dict[str, int | None]) -> None:
    rules = Constraints(ROLES, order=order)
    assert not rules.forbids("m", "n")
    assert not rules.forbids("n", "m")


@given(PLACES)
def test_order_only_adds_rules(order: dict[str, int | None]) -> None:
    plain, ordered = Constraints(ROLES), Constraints(ROLES, order=order)
    pairs = [(a, b) for a in ROLES for b in ROLES if a != b]
    assert all(ordered.forbids(*pair) for pair in pairs if plain.forbids(*pair))
    assert not any(ordered.forbids(a, b) for a in "op" for b in "mn")


@given(PLACES)
def test_a_pair_is_separate_only_when_neither_may_cause_the_other(order: dict[str, int | None]) -> None:
    rules = Constraints(ROLES, order=order)
    for a in ROLES:
        for b in ROLES:
            if a != b:
                assert rules.separates(a, b) == rules.separates(b, a)
    assert not rules.separates("m", "n")
    assert not rules.separates("o", "y")
    assert rules.separates("o", "p")


def test_order_comes_from_the_profile() -> None:
    schema = schema_of({"o": O, "m": M, "n": M, "y": Y})
    variables = {
        **schema.variables,
        "m": replace(schema.variables["m"], order=2),
        "n": replace(schema.variables["n"], order=1),
    }
    rules = Constraints.of(replace(schema, variables=variables))
    assert rules.forbids("m", "n")
    assert not rules.forbids("n", "m")


def test_only_a_possible_cause_explains_a_dependence_away() -> None:
    rules = Constraints(ROLES, order={"m": 2, "n": 1})
    assert rules.may_explain("n", "m")
    assert not rules.may_explain("m", "n")
    assert not rules.may_explain("y", "z")

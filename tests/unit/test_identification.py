from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from care_core.causal.graph import CausalGraph
from care_core.learn.identification import identify, is_answered_by
from tests.simulated import simulate


def graph(directed: str, bidirected: str = "") -> CausalGraph:
    """From `a>b b>c` and `a-b`."""
    arrows = [tuple(edge.split(">")) for edge in directed.split()]
    arcs = [tuple(edge.split("-")) for edge in bidirected.split()]
    nodes = sorted({node for edge in (*arrows, *arcs) for node in edge})
    return CausalGraph(tuple(nodes), frozenset(arrows), frozenset(arcs))  # type: ignore[arg-type]


def test_a_randomised_option_needs_no_adjustment() -> None:
    answer = identify(graph("x>m m>y z>m", "m-y"), "x", "y")
    assert answer.identified
    assert answer.by_adjustment
    assert answer.adjustment == ()
    assert answer.functional == "p(y|x)"


def test_a_context_that_chose_the_option_is_adjusted_for() -> None:
    answer = identify(graph("c>x c>m x>m m>y"), "x", "y")
    assert answer.adjustment == ("c",)
    assert answer.functional == "sum_{c} p(y|x,c) p(c)"


def test_a_shared_hidden_cause_of_option_and_first_metric_blocks_identification() -> None:
    answer = identify(graph("x>m m>y", "m-x"), "x", "y")
    assert not answer.identified
    assert answer.functional == ""


def test_the_front_door_is_identified_but_not_by_adjustment() -> None:
    answer = identify(graph("x>m m>y", "x-y"), "x", "y")
    assert answer.identified
    assert not answer.by_adjustment
    assert answer.functional == "sum_{m} phi_{m,x}(p(V)) phi_{x,y}(p(V))"


def test_an_option_without_a_path_changes_nothing() -> None:
    answer = identify(graph("x>m z>y"), "x", "y")
    assert answer.identified
    assert answer.functional == "p(y)"


def test_every_option_of_a_randomised_robot_is_identified(capfd: pytest.CaptureFixture[str]) -> None:
    _, schema, truth = simulate(10, np.random.default_rng(0), options=12, metrics=8, hidden=4, objectives=2)
    answers = [identify(truth, o.name, y.name) for o in schema.options for y in schema.objectives]
    assert all(answer.identified and answer.adjustment == () for answer in answers)
    assert capfd.readouterr().out == ""


def test_the_functional_does_not_depend_on_the_hash_seed() -> None:
    script = (
        "from care_core.causal.graph import CausalGraph\n"
        "from care_core.learn.identification import identify\n"
        "g = CausalGraph(('x', 'm', 'n', 'y'), frozenset({('x', 'm'), ('m', 'y'), ('n', 'y'), ('m', 'n')}),"
        " frozenset({('x', 'y'), ('m', 'n')}))\n"
        "print(identify(g, 'x', 'y').functional)\n"
    )
    texts = {
        subprocess.run(
            [sys.executable, "-c", script],
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("1", "2", "3")
    }
    assert len(texts) == 1
    assert texts.pop().startswith("sum_{m,n} ")


def test_a_regression_answers_where_it_holds_what_chose_the_option() -> None:
    chosen = graph("c>x c>m x>m m>y")
    assert is_answered_by(chosen, "x", "y", ["x", "c"])
    assert not is_answered_by(chosen, "x", "y", ["x"])


def test_the_front_door_and_an_adjusting_metric_are_not_answered_by_options_and_contexts() -> None:
    front_door, through_metric = graph("x>m m>y", "x-y"), graph("x>m m>y n>y", "x-n")
    assert identify(front_door, "x", "y").identified
    assert not is_answered_by(front_door, "x", "y", ["x"])
    assert identify(through_metric, "x", "y").adjustment == ("n",)
    assert not is_answered_by(through_metric, "x", "y", ["x"])

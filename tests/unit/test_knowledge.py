from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from care_core.causal.graph import CausalGraph
from care_core.errors import ProfileError
from care_core.learn.fitting import Effort
from care_core.learn.knowledge import with_known
from care_core.learn.outcomes import FEW_RUNS, fit_total
from care_core.profile.reading import read_schema
from care_core.profile.schema import Schema
from care_core.records import replace
from tests.planted import SCHEMA, fly_many

BARE = CausalGraph(tuple(SCHEMA.variables))
RUNS = fly_many(FEW_RUNS)
"""As many as let a mechanism read its causes alone."""
QUICK = Effort(points=120, iterations=20)


def knowing(*edges: tuple[str, str]) -> Schema:
    return replace(SCHEMA, known=frozenset(edges))


def test_what_is_known_joins_the_graph() -> None:
    graph = with_known(BARE, RUNS, knowing(("reserve", "hold_s"), ("hold_s", "time")))
    assert "reserve" in graph.ancestors("time")


def test_an_arrow_that_was_found_is_not_turned() -> None:
    found = CausalGraph(BARE.nodes, frozenset({("hold_s", "sag")}))
    assert with_known(found, RUNS, knowing(("sag", "hold_s"))).directed == {("hold_s", "sag")}


def test_known_edges_make_no_cycle_among_themselves() -> None:
    graph = with_known(BARE, RUNS, knowing(("sag", "hold_s"), ("hold_s", "replans"), ("replans", "sag")))
    assert len(graph.directed) == 2


def test_what_cannot_be_or_never_varies_is_left_out() -> None:
    still = RUNS.assign(reserve=20.0)
    assert not with_known(BARE, still, knowing(("reserve", "hold_s"), ("time", "sag"), ("speed", "time"))).directed


def test_a_known_cause_is_learned_where_the_search_found_none() -> None:
    schema, rng = knowing(("reserve", "hold_s")), np.random.default_rng(0)
    assert fit_total("hold_s", RUNS, SCHEMA, BARE, rng, effort=QUICK) is None
    mechanism = fit_total("hold_s", RUNS, schema, BARE, rng, effort=QUICK)
    assert mechanism is not None
    assert mechanism.inputs == ("reserve",)


def test_a_known_cause_that_predicts_nothing_is_not_kept() -> None:
    schema = knowing(*((name, "hold_s") for name in ("inert", "filter", "planner", "accel", "radius", "speed")))
    found = CausalGraph(BARE.nodes, frozenset({("reserve", "hold_s")}))
    mechanism = fit_total("hold_s", RUNS.iloc[:30], schema, found, np.random.default_rng(0), effort=QUICK)
    assert mechanism is not None
    x = np.array([[row[name] for name in mechanism.inputs] for row in RUNS.to_dict("records")])
    away = x.copy()
    for name in set(mechanism.inputs) - {"reserve"}:
        away[:, mechanism.inputs.index(name)] = RUNS[name].mean()
    assert np.abs(mechanism.latent(x) - mechanism.latent(away)).max() < 0.3 * mechanism.scale


def test_a_name_that_is_not_declared_is_an_error(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "profiles" / "arducopter" / "profile.yaml").read_text()
    (tmp_path / "profile.yaml").write_text(text.replace("causes: [LAND_SPEED]", "causes: [LAND_SPED]"))
    with pytest.raises(ProfileError) as caught:
        read_schema(tmp_path / "profile.yaml")
    assert caught.value.message == (
        "Under 'known' stands 'LAND_SPED', which the profile does not declare. Did you mean 'LAND_SPEED'?"
    )

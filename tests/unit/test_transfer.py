from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from care_core.causal.mechanisms import Mechanism
from care_core.errors import LearningError
from care_core.learn.fitting import Effort
from care_core.learn.outcomes import inputs_of
from care_core.learn.transfer import out_of_support, started_from, transfer_to, update
from care_core.profile.model import read_model, write_model
from care_core.profile.store import Profile
from care_core.records import replace
from tests.planted import DEFAULTS, SCHEMA, SETTINGS, fly_many


def heavier(frame: pd.DataFrame) -> pd.DataFrame:
    """The planted robot with a load: everything takes longer, and drawing current tells more."""
    loaded: pd.DataFrame = frame.assign(time=1.3 * frame["time"] + 10, energy=frame["energy"] + 3 * frame["sag"])
    return loaded


def error(mechanisms: Mapping[str, Mechanism], test: pd.DataFrame, name: str) -> float:
    known = test.dropna(subset=[name])
    mechanism = mechanisms[name]
    x = known[list(mechanism.inputs)].to_numpy(float)
    return float(np.sqrt(np.mean((mechanism.expected(x) - known[name]) ** 2)))


@pytest.mark.parametrize("name", ["time", "energy"])
def test_target_runs_bring_the_prediction_to_the_target(planted: Profile, name: str) -> None:
    test, few, many = heavier(fly_many(150, seed=7)), heavier(fly_many(40, seed=8)), heavier(fly_many(150, seed=9))
    graph, rng = planted.model.graph, np.random.default_rng(0)
    errors = [error(planted.model.mechanisms, test, name)]
    for runs in (few, many):
        _, mechanisms = transfer_to(planted.model, SCHEMA, runs, graph, rng)
        errors.append(error(mechanisms, test, name))
    assert errors[0] > 1.5 * errors[1] > 1.5 * 0.9 * errors[2]


def test_an_updated_model_survives_the_disk_and_answers_the_same(planted: Profile, tmp_path: Path) -> None:
    model = update(planted.model, SCHEMA, heavier(fly_many(60, seed=8)), replace(SETTINGS, origin="runs.csv"))
    write_model(model, tmp_path)
    again = read_model(tmp_path)
    assert again.mechanisms.keys() == model.mechanisms.keys() == planted.model.mechanisms.keys()
    for key, mechanism in model.mechanisms.items():
        assert mechanism.prior is not None or key not in ("time", "energy")
        x = np.array([[DEFAULTS[name] for name in mechanism.inputs]])
        np.testing.assert_allclose(again.mechanisms[key].expected(x), mechanism.expected(x), rtol=1e-5)
        there = again.mechanisms[key].posterior(x)
        np.testing.assert_allclose(there.change_sd(there), 0.0, atol=1e-4)
    assert "carried over with runs.csv" in again.training.origin
    assert again.effects


def test_updating_twice_keeps_the_whole_history(planted: Profile, tmp_path: Path) -> None:
    graph, rng = planted.model.graph, np.random.default_rng(0)
    _, once = transfer_to(planted.model, SCHEMA, heavier(fly_many(60, seed=8)), graph, rng)
    first = replace(planted.model, mechanisms=once)
    _, twice = transfer_to(first, SCHEMA, heavier(fly_many(60, seed=9)), graph, rng)
    write_model(replace(planted.model, mechanisms=twice), tmp_path)
    prior = read_model(tmp_path).mechanisms["time"].prior
    assert prior is not None
    assert prior[0].prior is not None


def test_options_that_left_the_source_are_named(planted: Profile) -> None:
    runs = fly_many(40, seed=3)
    for option in SCHEMA.options:
        summary = planted.model.summaries[option.name]
        runs[option.name] = runs[option.name].clip(summary.low, summary.high)
    assert out_of_support(planted.model, SCHEMA, runs) == ()
    runs.loc[0, "speed"] = 25.0
    (found,) = out_of_support(planted.model, SCHEMA, runs)
    assert found.option == "speed"
    assert "'speed' is outside the source's support" in str(found)


def test_too_few_runs_are_refused(planted: Profile) -> None:
    with pytest.raises(LearningError, match="are needed"):
        update(planted.model, SCHEMA, fly_many(2), SETTINGS)


def slower(frame: pd.DataFrame) -> pd.DataFrame:
    """The planted robot with worn wheels: everything takes a quarter longer."""
    worn: pd.DataFrame = frame.assign(time=1.25 * frame["time"])
    return worn


def test_ten_runs_tell_what_they_have_in_common(planted: Profile) -> None:
    test, few = slower(fly_many(150, seed=7)), slower(fly_many(10, seed=8))
    _, mechanisms = transfer_to(planted.model, SCHEMA, few, planted.model.graph, np.random.default_rng(0))
    assert error(mechanisms, test, "time") < 0.6 * error(planted.model.mechanisms, test, "time")


@pytest.mark.parametrize("runs", [4, 10, 30])
def test_runs_of_the_same_robot_hardly_move_it(planted: Profile, runs: int) -> None:
    test, few = fly_many(150, seed=7), fly_many(runs, seed=8)
    _, mechanisms = transfer_to(planted.model, SCHEMA, few, planted.model.graph, np.random.default_rng(0))
    for name in ("time", "energy"):
        assert error(mechanisms, test, name) < 1.15 * error(planted.model.mechanisms, test, name)


def test_with_few_runs_the_source_keeps_its_graph_and_its_support(planted: Profile, tmp_path: Path) -> None:
    few = slower(fly_many(10, seed=8))
    model = update(planted.model, SCHEMA, few, replace(SETTINGS, origin="worn.csv"))
    assert (model.graph, model.effects) == (planted.model.graph, planted.model.effects)
    for option in SCHEMA.options:
        summary = planted.model.summaries[option.name]
        assert model.supports(option.name, summary.low)
        assert model.supports(option.name, float(few[option.name].max()))
    write_model(model, tmp_path)
    again = read_model(tmp_path).mechanisms["time"]
    x = np.array([[DEFAULTS[name] for name in again.inputs]])
    np.testing.assert_allclose(again.expected(x), model.mechanisms["time"].expected(x), rtol=1e-5)


def test_what_the_source_does_not_know_a_carried_mechanism_does_not_know_either(planted: Profile) -> None:
    _, mechanisms = transfer_to(
        planted.model, SCHEMA, slower(fly_many(10, seed=8)), planted.model.graph, np.random.default_rng(0)
    )
    carried, source = mechanisms["time"], planted.model.mechanisms["time"]
    near = np.array([[DEFAULTS[name] for name in carried.inputs]])
    far = near * 4
    places = [carried.inputs.index(name) for name in source.inputs]
    for x in (near, far):
        assert carried.latent_sd(x)[0] >= source.latent_sd(x[:, places])[0]
        there, here = carried.posterior(x), carried.posterior(near)
        assert np.all(np.abs(there.covariance(here)) <= np.sqrt(there.variance * here.variance) * (1 + 1e-6))
    assert carried.posterior(near).epistemic_ratio[0] < carried.posterior(far).epistemic_ratio[0]


def test_many_runs_of_few_missions_are_no_regression(planted: Profile) -> None:
    source, runs = planted.model.mechanisms["energy"], heavier(fly_many(40, seed=8)).dropna(subset=["energy"])
    inputs = inputs_of(source.inputs, SCHEMA)
    x, y = runs[list(source.inputs)].to_numpy(float), runs["energy"].to_numpy(float)
    quick = Effort(points=120, iterations=15)
    of_three = started_from(source, x, y, inputs, np.arange(len(y)) % 3, np.random.default_rng(0), quick)
    assert len(of_three.reads) == 0
    assert of_three.prior == (source, 1.0)

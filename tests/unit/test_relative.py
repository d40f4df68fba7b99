"""Missions of different lengths: what is learned is the ratio to what physics says, and errors are those of others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from care_core.learn.fitting import Effort, Inputs, fit, left_out
from care_core.learn.outcomes import fit_total, inputs_of, met
from care_core.learn.relative import left_out_together, missions_of, needs, relative
from care_core.learn.repeats import repeated
from care_core.learn.structure import learn_structure
from care_core.numbers import Floats
from care_core.profile.reading import parse_schema
from care_core.profile.schema import Schema

TEXT = """
schema_version: 1
name: climber
version: "1"
platform: made up
variables:
  speed_up: {role: option, range: [50, 500], default: 250, unit: cm/s}
  gain: {role: option, range: [0, 1], default: 0.5}
  takeoff_height: {role: context, about: mission, unit: m}
  done: {role: objective, kind: functional, threshold: {op: "==", value: 1}}
  takeoff_time:
    role: objective
    kind: non-functional
    unit: s
    nominal: {kind: multicopter_takeoff_time, climb_speed: speed_up}
    threshold: {op: "<=", ratio: 1.3}
"""
SCHEMA: Schema = parse_schema(TEXT, Path("climber.yaml"))
QUICK = Effort(points=200, iterations=25)


def climbs(n: int = 160, missions: int = 20) -> pd.DataFrame:
    """Climbs that take a third longer than physics says, and longer still away from the middle of the gain."""
    rng = np.random.default_rng(0)
    mission = np.arange(n) % missions
    height = np.linspace(5, 80, missions)[mission]
    first = np.arange(n) < missions
    speed = np.where(first, 250.0, rng.uniform(80, 500, n))
    gain = np.where(first, 0.5, rng.uniform(0, 1, n))
    frame = pd.DataFrame({"speed_up": speed, "gain": gain, "takeoff_height": height, "done": 1.0, "takeoff_time": 1.0})
    frame.loc[n // 2, "done"] = 0.0
    nominal = SCHEMA.nominal_of("takeoff_time")
    assert nominal is not None
    took = nominal.of(frame[list(nominal.inputs)].to_numpy())
    flown: pd.DataFrame = frame.assign(
        takeoff_time=took * 4 / 3 * np.exp(2 * (gain - 0.5) ** 2 + 0.02 * rng.normal(size=n))
    )
    return flown


def test_runs_of_one_mission_share_a_number() -> None:
    missions = missions_of(climbs(), SCHEMA)
    assert missions is not None
    assert len(np.unique(missions)) == 20
    assert (missions[:20] == missions[20:40]).all()


def test_at_the_reference_every_mission_has_the_same_ratio() -> None:
    ratio = relative(climbs(), SCHEMA)["takeoff_time"].to_numpy()[:20]
    np.testing.assert_allclose(ratio, 4 / 3, rtol=0.08)


def test_a_run_is_judged_by_what_the_reference_took_on_its_mission() -> None:
    frame = climbs()
    objective = SCHEMA.variables["takeoff_time"]
    need = needs(objective, frame, SCHEMA)
    np.testing.assert_allclose(need[20:40], frame["takeoff_time"][:20])
    kept = met(objective, frame, SCHEMA)
    assert (kept[:20] == 1).all()
    np.testing.assert_array_equal(kept == 1, frame["takeoff_time"] <= np.array([float(f"{1.3 * n:.4g}") for n in need]))


def test_a_mission_without_a_reference_run_is_judged_by_its_nominal() -> None:
    frame = climbs()
    objective = SCHEMA.variables["takeoff_time"]
    known = needs(objective, frame, SCHEMA)
    without = frame.drop(index=0).reset_index(drop=True)
    np.testing.assert_allclose(needs(objective, without, SCHEMA)[19], known[20], rtol=0.1)


def test_the_mechanism_predicts_heights_that_no_run_had() -> None:
    frame = climbs()
    graph = learn_structure(frame, SCHEMA, rng=np.random.default_rng(0)).graph
    mechanism = fit_total("takeoff_time", frame, SCHEMA, graph, np.random.default_rng(0), effort=QUICK)
    assert mechanism is not None
    names = list(mechanism.inputs)
    there = pd.DataFrame({"speed_up": [100.0, 400.0], "gain": 0.5, "takeoff_height": [200.0, 200.0]})
    nominal = SCHEMA.nominal_of("takeoff_time")
    assert nominal is not None
    expected = nominal.of(there[list(nominal.inputs)].to_numpy()) * 4 / 3
    np.testing.assert_allclose(mechanism.expected(there[names].to_numpy()), expected, rtol=0.06)


def test_what_only_the_nominal_needs_is_not_read() -> None:
    nominal = SCHEMA.nominal_of("takeoff_time")
    inputs = inputs_of(["gain"], SCHEMA, nominal)
    assert dict(zip(inputs.names, inputs.read.tolist(), strict=True)) == {
        "gain": True, "takeoff_height": False, "speed_up": False,
    }  # fmt: skip


def grouped() -> tuple[Floats, Floats, np.ndarray[tuple[int], np.dtype[np.int64]]]:
    """Ten groups with an offset each that their place tells."""
    rng = np.random.default_rng(0)
    groups = np.repeat(np.arange(10), 8)
    offset = rng.normal(size=10)
    x = np.column_stack([rng.uniform(size=80), rng.normal(size=10)[groups]])
    return x, offset[groups] + 0.05 * rng.normal(size=80), groups


def test_errors_of_left_out_groups_are_those_of_refitting_without_them() -> None:
    x, y, groups = grouped()
    inputs = Inputs.all_read(("a", "b"), np.zeros(2, dtype=bool))
    m = fit(x, y, inputs, binary=False, effort=QUICK, transform="identity").mechanism
    errors, error_sd = left_out(m.kernel, m.points, m.targets, groups)
    own = groups == 3
    rest, noise = m.points[~own], m.kernel.noise**2 + 1e-6
    weights = np.linalg.solve(m.kernel.among(rest) + noise * np.eye(len(rest)), m.targets[~own])
    np.testing.assert_allclose(errors[own], m.targets[own] - m.kernel(m.points[own], rest) @ weights, atol=1e-6)
    alone, _ = left_out(m.kernel, m.points, m.targets)
    assert np.abs(errors).mean() > 1.3 * np.abs(alone).mean()
    assert error_sd.mean() > 0


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ("climb_speed: speed_up}", "kind: none_such}"),
        ("climb_speed: speed_up}", "climb_speed: vz}"),
        ("ratio: 1.3", "at_least: 3"),
        ("about: mission", "about: weather"),
    ],
    ids=["formula", "argument", "bound", "about"],
)
def test_a_profile_says_what_is_wrong_with_it(change: str, says: str) -> None:
    from care_core.errors import ProfileError

    with pytest.raises(ProfileError):
        parse_schema(TEXT.replace(change, says), Path("climber.yaml"))


def test_nine_runs_that_never_began_make_no_missions_of_a_campaign() -> None:
    """Else nearly all runs would be left out together, and errors held against what is known without any."""
    frame = climbs(missions=1)
    frame.loc[20:28, ["takeoff_height", "takeoff_time"]] = np.nan
    assert missions_of(frame, SCHEMA) is None
    assert len(np.unique(left_out_together(frame, SCHEMA))) == len(frame)


def test_repeats_of_a_configuration_are_left_out_with_it() -> None:
    frame = climbs(missions=1)
    frame.loc[50:59, ["speed_up", "gain"]] = frame.loc[60:69, ["speed_up", "gain"]].to_numpy()
    together = left_out_together(frame, SCHEMA)
    assert (together[50:60] == together[60:70]).all()
    assert len(np.unique(together)) == len(frame) - 10


def test_a_robot_that_starts_a_little_beside_its_place_repeats_its_configuration_all_the_same() -> None:
    frame = climbs(missions=1)
    frame.loc[50:59, ["speed_up", "gain"]] = frame.loc[60:69, ["speed_up", "gain"]].to_numpy()
    frame["takeoff_height"] += np.linspace(-0.02, 0.02, len(frame))
    same, another = repeated(frame, SCHEMA)
    assert not same
    assert another == [(50 + i, 60 + i) for i in range(10)]
    frame.loc[50:59, "takeoff_height"] = 80.0  # on another mission a configuration is no repeat
    assert repeated(frame, SCHEMA) == ([], [])


def test_parts_of_which_one_holds_nearly_all_runs_are_no_test() -> None:
    frame = climbs()
    frame.loc[20:, "takeoff_height"] = 5.0  # one mission of many runs beside nineteen of one
    missions = missions_of(frame, SCHEMA)
    assert missions is not None
    assert len(np.unique(missions)) == 20
    assert len(np.unique(left_out_together(frame, SCHEMA))) == len(frame)


def test_intervals_of_a_campaign_with_one_mission_hold_what_they_promise() -> None:
    """Of new configurations, eight of ten fall inside the 80% interval, though some training runs never began."""
    frame = climbs(460, missions=1)
    campaign, new = frame[:160].copy(), frame[160:]
    campaign.loc[20:28, ["takeoff_height", "takeoff_time"]] = np.nan
    graph = learn_structure(campaign, SCHEMA, rng=np.random.default_rng(0)).graph
    effort = Effort(points=200, iterations=25, folds=5)
    m = fit_total("takeoff_time", campaign, SCHEMA, graph, np.random.default_rng(0), effort=effort)
    assert m is not None
    x = new[list(m.inputs)].to_numpy()
    z = (np.log(new["takeoff_time"].to_numpy()) - m.latent(x)) / np.hypot(m.latent_sd(x), m.noise_at(x))
    inside = (z > m.error_quantile(0.1)) & (z < m.error_quantile(0.9))
    assert 0.72 < inside.mean() < 0.88

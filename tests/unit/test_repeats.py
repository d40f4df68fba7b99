"""How much noise a run meets again, from tables whose repeats were planted."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from care_core.causal.model import OutcomeRecord
from care_core.learn.fitting import METRIC, fit_mechanism
from care_core.learn.outcomes import inputs_of
from care_core.learn.repeats import carry_over, reference_runs, repeated
from care_core.learn.table import check_table
from care_core.tables.rows import CONDITIONS
from tests.planted import DEFAULTS, SCHEMA, fly_many


def table(share: float, pairs: int = 80) -> pd.DataFrame:
    """Missions whose time has a noise that repeats under the same conditions, with every fourth run repeated."""
    rng = np.random.default_rng(0)
    rows = []
    for day in range(3 * pairs):
        speed, noise = float(rng.uniform(2, 9)), rng.normal()
        again = share * noise + np.sqrt(1 - share**2) * rng.normal()
        for met in (noise, again) if day < pairs else (noise,):
            rows.append({**DEFAULTS, "speed": speed, "time": 100 + 5 * speed + 8 * met, CONDITIONS: day})
        if day < pairs:
            rows.append({**DEFAULTS, "speed": speed, "time": 100 + 5 * speed + 8 * rng.normal(), CONDITIONS: -day - 1})
    frame: pd.DataFrame = pd.DataFrame(rows)
    return frame


@pytest.mark.parametrize("share", [0.1, 0.8])
def test_the_share_that_was_planted_is_found(share: float) -> None:
    frame = table(share)
    inputs = inputs_of(["speed"], SCHEMA)
    rng = np.random.default_rng(0)
    x, y = frame[["speed"]].to_numpy(), frame["time"].to_numpy()
    mechanism = fit_mechanism(x, y, inputs, binary=False, rng=rng, effort=METRIC, transform="identity")
    found = carry_over(frame, SCHEMA, {"time": OutcomeRecord(objective="time", mechanism="time")}, {"time": mechanism})
    assert found["time"].same == pytest.approx(share, abs=0.15)
    assert found["time"].another < 0.2
    assert found["time"].pairs == (80, 80)


def test_without_repeats_nothing_is_said() -> None:
    assert carry_over(fly_many(60), SCHEMA, {}, {}) == {}


def test_runs_of_one_date_are_the_same_conditions_and_an_unknown_date_is_none() -> None:
    frame = fly_many(60)
    frame.loc[[1, 2, 3], list(DEFAULTS)] = frame.loc[[0], list(DEFAULTS)].to_numpy()
    frame["log_start"] = ["2026-05-01T10:00:00", "2026-05-01T17:00:00", "2026-05-02T09:00:00", *[None] * 57]
    same, another = repeated(check_table(frame, SCHEMA), SCHEMA)
    assert (0, 1) in same
    assert {(1, 2), (2, 3)} <= set(another)


def test_runs_at_the_reference_are_counted_with_those_that_missed_an_objective() -> None:
    frame = fly_many(60)
    assert reference_runs(frame, SCHEMA).runs == 0
    frame.loc[:9, list(DEFAULTS)] = list(DEFAULTS.values())
    frame.loc[:9, "time"], frame.loc[:9, "success"] = 100.0, 1.0
    frame.loc[[2, 5], "success"] = 0.0
    counted = reference_runs(check_table(frame, SCHEMA), SCHEMA)
    assert (counted.runs, counted.failed >= 2) == (10, True)

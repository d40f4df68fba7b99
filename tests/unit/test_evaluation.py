from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from benchmarks.artifact import named, slopes
from care_core.errors import LearningError
from care_core.learn.evaluation import CAUSES, evaluate
from care_core.learn.fault_files import read_faults
from care_core.learn.naming import by_deviation, by_paper_rule, usual_values
from care_core.profile.store import Profile, load_profile
from care_core.records import replace
from tests.planted import DEFAULTS, OPTIONS, SCHEMA, draw_noise, fly

NAMES = [option.name for option in OPTIONS]


def write_fault(folder: Path, number: int, faulty: dict[str, float], *, robot: str = "toy") -> None:
    """A fault of the mission time: two slow runs, then eight as shipped."""
    rng = np.random.default_rng(number)
    configs = [{**DEFAULTS, **faulty}] * 2 + [dict(DEFAULTS)] * 8
    rows = [{**config, **fly(config, draw_noise(rng))} for config in configs]
    pd.DataFrame(rows).to_csv(folder / f"{robot}_fault_time_{number}.csv", index=False)


def write_causes(path: Path, causes: list[set[str]]) -> None:
    pd.DataFrame([{name: int(name in row) for name in NAMES} for row in causes]).to_csv(path, index=False)


@pytest.fixture
def faults(tmp_path: Path) -> Path:
    write_fault(tmp_path, 1, {"speed": 1.5, "inert": 0.9})
    write_fault(tmp_path, 2, {"planner": 2.0})
    write_causes(tmp_path / "toy_ground_truth_time.csv", [{"speed"}, {"planner", "accel"}])
    write_causes(tmp_path / "toy_predictions_time.csv", [{"speed"}, {"filter"}])
    return tmp_path


def test_causes_are_options_off_in_the_faulty_runs_then_strong_ones(planted: Profile, faults: Path) -> None:
    first, second = read_faults(faults, SCHEMA)
    assert usual_values(SCHEMA, first, {**DEFAULTS, "speed": 1.5}) == DEFAULTS
    ranking = by_deviation(SCHEMA, planted.model, first)
    assert ranking[:2] == ["speed", "inert"]
    assert by_deviation(SCHEMA, planted.model, second)[0] == "planner"


def test_where_options_were_drawn_at_random_the_usual_value_is_the_nearest_that_good_runs_had(faults: Path) -> None:
    first, _ = read_faults(faults, SCHEMA)
    rng = np.random.default_rng(0)
    rows = [{**DEFAULTS, "speed": float(v)} for v in rng.uniform(2.0, 8.0, 40)]
    others = pd.DataFrame([{**row, "time": 200.0 if row["speed"] < 4 else 100.0, "success": 1.0} for row in rows])
    drawn = replace(first, runs=pd.concat([first.runs[:2], others], ignore_index=True))
    kept = others.loc[others["time"] < 175, "speed"]
    usual = usual_values(SCHEMA, drawn, {**DEFAULTS, "speed": 1.5})["speed"]
    assert kept.min() < usual < kept.quantile(0.1)
    assert usual_values(SCHEMA, drawn, {**DEFAULTS, "speed": 6.0})["speed"] == 6.0, "good runs had that too"


def test_the_papers_rule_keeps_ties_and_leaves_constants_out(faults: Path) -> None:
    first, second = read_faults(faults, SCHEMA)
    assert by_paper_rule(SCHEMA, first) == {"speed", "inert"}, "they moved together, so their slopes are the same"
    assert by_paper_rule(SCHEMA, second) == {"planner"}


def test_the_measures_are_counted_over_all_cells(planted: Profile, faults: Path) -> None:
    evaluation = evaluate(SCHEMA, planted.model, read_faults(faults, SCHEMA))
    published = evaluation.scores[CAUSES]["published"]
    # Of 16 cells: speed hit, planner and accel missed, filter named in vain.
    assert published.accuracy == pytest.approx(13 / 16)
    assert published.precision == 0.5
    assert published.recall == pytest.approx(1 / 3)
    assert published.f1 == pytest.approx(0.4)
    planner = planted.model.effects["planner", "time"].effect
    assert published.rmse == pytest.approx(np.sqrt(planner**2 / 16))
    care = evaluation.scores[CAUSES]["care"]
    assert care.recall >= published.recall
    assert [fault.fixed for fault in evaluation.faults] == [frozenset(), {"accel"}]


def test_cbi_names_the_option_that_goes_with_the_failures(planted: Profile, faults: Path) -> None:
    evaluation = evaluate(SCHEMA, planted.model, read_faults(faults, SCHEMA))
    assert evaluation.predicted["cbi"]["time 2"] == {"planner"}


def test_without_published_predictions_there_is_no_such_row(planted: Profile, faults: Path) -> None:
    (faults / "toy_predictions_time.csv").unlink()
    assert "published" not in evaluate(SCHEMA, planted.model, read_faults(faults, SCHEMA)).scores[CAUSES]


def test_a_folder_that_cannot_be_graded_is_refused(faults: Path, tmp_path: Path) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(LearningError, match="holds no fault"):
        read_faults(empty, SCHEMA)
    write_fault(faults, 3, {"planner": 2.0})
    with pytest.raises(LearningError, match="no row for time 3"):
        read_faults(faults, SCHEMA)
    (faults / "toy_fault_time_3.csv").unlink()
    (faults / "toy_ground_truth_time.csv").rename(faults / "truths.csv")
    with pytest.raises(LearningError, match="no table of true causes for 'time'"):
        read_faults(faults, SCHEMA)
    assert len(read_faults(faults, SCHEMA, [faults / "truths.csv"])) == 2
    write_fault(faults, 1, {}, robot="other")
    with pytest.raises(LearningError, match="several robots"):
        read_faults(faults, SCHEMA)


@pytest.mark.long
def test_the_published_predictions_score_as_published(recorded: Path) -> None:
    profile = load_profile("husky-care")
    evaluation = evaluate(profile.schema, profile.model, read_faults(recorded / "data" / "care", profile.schema))
    scores = evaluation.scores[CAUSES]
    published, care, cbi = (scores[method] for method in ("published", "care", "cbi"))
    assert round(published.accuracy, 3) == 0.956
    assert 0.81 <= scores["paper"].f1 <= 0.84
    assert [round(100 * value, 1) for value in (scores["published_varying"].f1, scores["oracle"].f1)] == [83.9, 92.1]
    assert scores["engine"].f1 > 1.3 * scores["engine_without_file"].f1, "outside the support the file is all there is"
    assert care.f1 > 2 * cbi.f1
    assert care.accuracy > 1 - 34 / 180, "better than naming nothing"


def test_the_artifacts_predictions_are_reproduced_to_the_last_bit(recorded: Path) -> None:
    schema = load_profile("husky-care").schema
    faults = read_faults(recorded / "data" / "care", schema)
    assert all(named(slopes(schema, fault)) == fault.published for fault in faults)

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_core.errors import LearningError
from care_core.learn.constraints import Constraints
from care_core.learn.relative import configurations_of
from care_core.learn.table import check_table, normal_scores, read_table, varying
from care_core.variables import Role
from tests.simulated import schema_of

SCHEMA = schema_of({"speed": Role.OPTION, "wind": Role.CONTEXT, "error": Role.METRIC, "energy": Role.OBJECTIVE})


@pytest.fixture
def frame() -> pd.DataFrame:
    rng = np.random.default_rng(0)
    table: pd.DataFrame = pd.DataFrame({name: rng.normal(size=40) for name in ("energy", "error", "speed", "wind")})
    return table


def test_columns_come_in_the_schemas_order_without_extras(tmp_path: Path, frame: pd.DataFrame) -> None:
    frame.loc[3, "energy"] = np.nan
    frame["log"] = "run.bag"
    for name, write in (("t.csv", frame.to_csv), ("t.parquet", frame.to_parquet)):
        write(tmp_path / name, index=False)
        read = read_table(tmp_path / name, SCHEMA)
        assert list(read) == ["speed", "wind", "error", "energy"]
        assert read["energy"].isna().tolist() == [i == 3 for i in range(40)]
        np.testing.assert_allclose(read["speed"], frame["speed"])


def test_yes_and_no_are_numbers(frame: pd.DataFrame) -> None:
    frame["energy"] = frame["energy"] > 0
    assert set(check_table(frame, SCHEMA)["energy"]) == {0.0, 1.0}


def test_a_missing_column_names_the_nearest(frame: pd.DataFrame) -> None:
    with pytest.raises(LearningError, match="no column 'energy'") as caught:
        check_table(frame.rename(columns={"energy": "enery"}), SCHEMA)
    assert "enery" in caught.value.hint


def test_text_in_a_cell_is_located(frame: pd.DataFrame) -> None:
    frame["error"] = frame["error"].astype(object)
    frame.loc[6, "error"] = "high"
    with pytest.raises(LearningError, match="not a number") as caught:
        check_table(frame, SCHEMA)
    assert caught.value.where == "row 7"


def test_an_option_must_be_known_in_every_run(frame: pd.DataFrame) -> None:
    frame.loc[0, "speed"] = np.inf
    with pytest.raises(LearningError, match="'speed' is missing"):
        check_table(frame, SCHEMA)


def test_few_runs_are_refused(frame: pd.DataFrame) -> None:
    with pytest.raises(LearningError, match="12 runs"):
        check_table(frame.head(12), SCHEMA)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("t.csv", b""),
        ("t.csv", b"\xff\xfe\x00"),
        ("t.csv", b'a,b\n"1,2\n3,4,5,6'),
        ("t.parquet", b"PAR1"),
        ("t.xls", b""),
    ],
)
def test_an_unreadable_file_is_one_sentence(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(LearningError) as caught:
        read_table(tmp_path / name, SCHEMA)
    assert "\n" not in str(caught.value)
    assert caught.value.where.endswith(name)


def test_no_such_file(tmp_path: Path) -> None:
    with pytest.raises(LearningError, match="No such file"):
        read_table(tmp_path / "none.csv", SCHEMA)


@given(st.lists(st.one_of(st.integers(-5, 5).map(float), st.just(np.nan)), min_size=1, max_size=40))
def test_scores_keep_order_ties_and_gaps(values: list[float]) -> None:
    data = np.array(values)
    scores = normal_scores(data)
    known = ~np.isnan(data)
    assert (np.isnan(scores) == ~known).all()
    for a, b in zip(data[known], scores[known], strict=True):
        assert ((data[known] < a) == (scores[known] < b - 1e-12)).all()
    if len(set(data[known])) > 1:
        assert scores[known].mean() == pytest.approx(0, abs=1e-9)
        assert scores[known].std() == pytest.approx(1)
    else:
        assert (scores[known] == 0).all()


def test_scores_ignore_any_monotonic_transformation() -> None:
    data = np.random.default_rng(0).normal(size=(50, 2))
    np.testing.assert_allclose(normal_scores(np.exp(3 * data)), normal_scores(data))


def test_what_holds_one_value_or_none_does_not_vary() -> None:
    frame = pd.DataFrame({"two": [1.0, 2.0, np.nan], "one": [3.0, 3.0, np.nan], "none": [np.nan] * 3})
    assert varying(frame, frame) == ("two",)
    assert varying(frame.iloc[:0], frame) == ()


def test_runs_of_one_configuration_have_one_number() -> None:
    schema = schema_of({"a": Role.OPTION, "b": Role.OPTION})
    frame = pd.DataFrame({"a": [2.0, 2.0, 1.0, 2.0, 1.0], "b": [0.0, 0.0, 0.0, 1.0, -0.0]})
    assert configurations_of(frame, schema).tolist() == [0, 0, 1, 2, 1]
    assert configurations_of(frame.iloc[2:4], schema).tolist() == [0, 1]


def test_constraints_say_why() -> None:
    rules = Constraints.of(SCHEMA)
    assert not rules.forbids("speed", "error")
    assert not rules.forbids("error", "energy")
    assert not rules.forbids("wind", "energy")
    for edge in [("energy", "error"), ("error", "speed"), ("error", "wind"), ("speed", "wind"), ("wind", "speed")]:
        assert rules.forbids(*edge)
        assert rules.reason(*edge)
    assert rules.forbids("speed", "energy")
    assert not rules.never_causes("speed", "energy")
    assert rules.is_exogenous("speed")


def test_an_observational_table_lets_context_choose_options() -> None:
    rules = Constraints.of(schema_of({"speed": Role.OPTION, "wind": Role.CONTEXT}, observational=True))
    assert not rules.forbids("wind", "speed")
    assert rules.forbids("speed", "wind")
    assert not rules.is_exogenous("speed")
    assert rules.is_exogenous("wind")

"""The public names of the core: the code of docs/notebook.md runs, and importing costs nothing until then."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

import care_core
from care_core.diagnose.records import Hypothesis
from care_core.errors import UsageError
from care_core.records import replace

ROOT = Path(__file__).parents[2]
SAMPLE = ROOT / "samples" / "arducopter_failed.BIN"


@pytest.fixture(scope="module")
def case() -> care_core.Case:
    return care_core.triage(SAMPLE)


def test_the_notebook_of_the_documents_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "notebook.md").read_text(encoding="utf-8"), re.DOTALL)
    (tmp_path / "samples").symlink_to(SAMPLE.parent)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    exec(compile(code, "notebook.md", "exec"), names)
    fix = names["case"].diagnosis.fix
    assert names["fault"].causes[0].option.name in {change.option.name for change in fix.changes}
    assert names["edited"].before == "LAND_SPEED,16\n" != names["edited"].after
    assert names["outcome"].verdict == "cannot_tell"  # it is the log that the report is about
    assert len(names["attitude"].t) == len(names["attitude"]["Roll"]) > 100
    assert "as driven" in capsys.readouterr().out


def test_the_missions_of_a_log_are_judged_as_the_one_of_the_case(case: care_core.Case) -> None:
    (mission,) = case.diagnosis.missions
    assert (mission.mission.index, mission.mission.ended) == (1, True)
    assert [(one.variable.name, one.value, one.status) for one in mission.results] == [
        (one.variable.name, one.value, one.status) for one in case.diagnosis.objectives
    ]


def test_every_public_name_is_there() -> None:
    assert all(getattr(care_core, name).__doc__ for name in care_core.__all__)
    assert not hasattr(care_core, "trage")


def test_what_if_takes_parameters_and_refuses_strangers(case: care_core.Case) -> None:
    assert case.schema is not None
    option = next(option for option in case.schema.options if option.parameters)
    current = case.diagnosis.run.config[option.name]
    answer = care_core.what_if(case, {option.parameters[0]: current})
    assert answer.p_ok == pytest.approx(answer.p_ok_now)
    with pytest.raises(UsageError, match="no parameter"):
        care_core.what_if(case, {"LAND_SPED": 40})


def test_a_case_keeps_its_log_open_and_reads_the_same_from_it(case: care_core.Case) -> None:
    from care_core.application.signals import signals_of, trace_of, whole_of
    from care_core.application.viewing import messages_of

    assert case.log is not None
    assert case.log.path == SAMPLE
    assert messages_of(case)
    trace = trace_of(case, signals_of(case)[0], whole_of(case), 40)
    assert trace.count > 0
    assert len(trace.columns) == 40


def test_what_a_failed_part_explains_is_taken_off_every_prediction_as_off_the_suggestion(case: care_core.Case) -> None:
    from care_core.application.case import predict

    plain = predict(case, {"LAND_SPEED": 40.0})
    half = (Hypothesis("hardware", "motor 2 lost thrust", 0.5), Hypothesis("parameter", "LAND_SPEED", 0.5))
    doubted = predict(replace(case, diagnosis=replace(case.diagnosis, hypotheses=half)), {"LAND_SPEED": 40.0})
    assert doubted.p_fixed == pytest.approx(plain.p_fixed / 2)

"""The public names of the core: the code of docs/notebook.md runs, and importing costs nothing until then."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

import care_core
from care_core.application.speaking import in_python
from care_core.diagnose.noisy_or import Key, NoisyOr
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


def test_dir_lists_the_public_names_and_imports_nothing() -> None:
    code = "import care_core, sys; print(*dir(care_core)); print('numpy' in sys.modules, 'msgspec' in sys.modules)"
    names, heavy = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    ).stdout.splitlines()
    assert names.split() == sorted(care_core.__all__)
    assert heavy == "False False"


def test_a_case_shows_itself_in_a_notebook(case: care_core.Case) -> None:
    page = case._repr_html_()
    ElementTree.fromstring(page)
    for part in ("<strong>FAULT</strong>", "LAND_SPEED", "mission_time", "164.7 s"):
        assert part in page
    assert "<script" not in page
    assert "<style" not in page


def test_no_text_of_a_log_is_markup_in_a_notebook(case: care_core.Case) -> None:
    hostile = "<img src=x onerror=alert(1)>"
    run = case.diagnosis.run
    log = replace(run.log, path=f"/x/{hostile}.BIN")
    diagnosis = replace(case.diagnosis, run=replace(run, log=log), hypotheses=(Hypothesis("hardware", hostile, 1.0),))
    page = replace(case, diagnosis=diagnosis)._repr_html_()
    assert "<img" not in page
    assert "&lt;img" in page


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        ({"thresholds": {"mision_time": 120}}, "thresholds: The profile has no objective 'mision_time'."),
        ({"thresholds": {"mission_time": "x"}}, "'mission_time' is 'x', not a number. Pass thresholds={'mission_time'"),
        ({"keep": ("LAND_SPED",)}, "keep: The profile has no parameter 'LAND_SPED'. Did you mean 'LAND_SPEED'?"),
        ({"keep": "LAND_SPEED"}, "keep: This is one name, not several. Pass ('LAND_SPEED',)."),
        ({"mission": 7}, "mission: There is no mission 7"),
        ({"profile": "arducoptr"}, "There is no profile 'arducoptr'. Did you mean 'arducopter'?"),
    ],
    ids=lambda given: str(given)[:30],
)
def test_errors_speak_of_arguments(asked: dict[str, Any], says: str) -> None:
    with pytest.raises(care_core.CareError) as refused:
        care_core.triage(care_core.Request(SAMPLE, **asked))
    assert says in str(refused.value)
    assert "--" not in str(refused.value)


def test_errors_of_changes_speak_of_them(case: care_core.Case) -> None:
    with pytest.raises(UsageError, match=r"changes: The value of 'LAND_SPEED' is 'fast', not a number\. Pass changes="):
        care_core.what_if(case, {"LAND_SPEED": "fast"})  # type: ignore[dict-item]
    with pytest.raises(UsageError, match="changes: The profile has no parameter 'LAND_SPED'"):
        care_core.what_if(case, {"LAND_SPED": 4})


@pytest.mark.parametrize(
    ("said", "told"),
    [
        ("give this mission's bound with --threshold energy=VALUE", "give this mission's bound pass"),
        ("Leave --profile out to have one chosen.", "Leave profile out to have one chosen."),
        ("look at it with --mission 2", "look at it with mission=2"),
        ("A configuration file goes with a log: --config FILE.", "goes with a log: configs=('FILE',)."),
        ("it is set by --set", "it is set by changes"),
    ],
)
def test_every_option_is_an_argument_in_python(said: str, told: str) -> None:
    assert "--" not in in_python(said)
    assert told.partition(" pass")[0] in in_python(said)


def test_every_option_that_the_core_speaks_of_is_known_in_python() -> None:
    """What belongs to other commands than the public functions (an output, a campaign) is not told by them."""
    others = {"all", "alpha", "anonymous", "changed", "force", "json", "junit", "markdown", "memory", "notify-command"}
    others |= {
        "out",
        "over",
        "parquet",
        "positions",
        "runs",
        "schema",
        "target",
        "yaml",
        "no-history",
        "workers",
        "scheduler",
    }
    sources = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "care_core" / "diagnose").rglob("*.py"))
    sources += "".join((ROOT / "care_core" / "extract" / name).read_text() for name in ("read.py", "select.py"))
    options = set(re.findall(r"--([a-z][a-z-]*)", sources)) - others
    assert options
    assert {option for option in options if "--" in in_python(f"--{option}")} == set()


def test_paths_may_be_texts() -> None:
    request = care_core.Request(str(SAMPLE), thresholds={"energy": 20.0})  # type: ignore[arg-type]
    assert care_core.triage(request).diagnosis.run.log.path == str(SAMPLE)


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
    from care_core.application.deciding import predict

    plain = predict(case, {"LAND_SPEED": 40.0})
    motor: Key = ("hardware", "motor 2 lost thrust")
    causes = NoisyOr({motor: 0.5, ("parameter", "LAND_SPEED"): 0.99})
    doubted = predict(replace(case, diagnosis=replace(case.diagnosis, failure=causes)), {"LAND_SPEED": 40.0})
    assert doubted.p_fixed < plain.p_fixed
    assert doubted.p_fixed <= 1 - causes.acts(motor)

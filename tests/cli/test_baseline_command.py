"""`care baseline`: what it prints, writes and ends with, and that `care triage` judges by what it wrote."""

from __future__ import annotations

import json
import re
from pathlib import Path

import jsonschema
import pytest

from care_core.profile.site import site_path
from care_core.report.baseline import BaselineDocument
from tests.conftest import Care

ROOT = Path(__file__).parents[2]
GOOD, SLOW = ROOT / "tests" / "data" / "arducopter_good.BIN", ROOT / "samples" / "arducopter_failed.BIN"


@pytest.fixture
def cut(tmp_path: Path) -> Path:
    """A flight whose log ends in the air."""
    path = tmp_path / "cut.BIN"
    path.write_bytes(GOOD.read_bytes()[:150_000])
    return path


def test_one_good_run_proposes_a_limit_for_every_objective(care: Care) -> None:
    done = care("baseline", GOOD)
    assert done.code == 0
    assert "1 good run of 1 mission in 1 log" in done.stdout
    for name in ("mission_time", "energy", "path_error_max"):
        assert f"{name}  <= " in done.stdout
    assert "spread of the profile's training runs" in " ".join(done.stdout.split())


def test_the_document_keeps_its_schema_and_refuses_what_failed(care: Care, cut: Path) -> None:
    done = care("baseline", GOOD, cut, "--json")
    document = json.loads(done.stdout)
    jsonschema.validate(document, BaselineDocument.json_schema())
    assert done.code == 3
    assert (document["runs"], document["logs"]) == (1, 2)
    (refused,) = document["refused"]
    assert refused["log"] == str(cut)
    assert "the log ends before the vehicle disarmed" in refused["reason"]
    assert all(limit["ratio"] > 0.5 for limit in document["limits"])


def test_a_log_counts_once(care: Care, tmp_path: Path) -> None:
    copy = tmp_path / "copy.BIN"
    copy.write_bytes(GOOD.read_bytes())
    done = care("baseline", GOOD, copy)
    assert done.code == 3
    assert "the same log as arducopter_good.BIN" in done.stdout


def test_a_slow_run_counts_and_that_is_said(care: Care) -> None:
    done = care("baseline", GOOD, SLOW, "--json")
    assert done.code == 0
    (over,) = json.loads(done.stdout)["over"]
    assert over["log"] == str(SLOW)
    assert "mission_time" in over["limits"]
    assert "as you call it good" in " ".join(care("baseline", SLOW).stdout.split())


def test_without_a_good_run_nothing_is_written(care: Care, cut: Path, tmp_path: Path) -> None:
    out = tmp_path / "site.yaml"
    done = care("baseline", cut, "--out", out)
    assert done.code == 3
    assert "0 good runs" in done.stdout
    assert not out.exists()


def test_no_log_that_can_be_read(care: Care, tmp_path: Path) -> None:
    broken = tmp_path / "broken.BIN"
    broken.write_bytes(b"nothing of a log")
    assert care("baseline", broken).code == 4
    assert care("baseline", tmp_path / "none.BIN").code == 2


def test_what_is_written_is_judged_by(care: Care, tmp_path: Path) -> None:
    out = tmp_path / "ours.yaml"
    assert care("baseline", GOOD, "--out", out).code == 0
    assert "limit of ours.yaml" in " ".join(care("triage", GOOD, "--site", out, "--no-history").stdout.split())
    site_path().parent.mkdir(parents=True, exist_ok=True)
    site_path().write_text(re.sub(r"ratio: [\d.]+", "ratio: 0.1", out.read_text(encoding="utf-8")), "utf-8")
    judged = care("triage", GOOD, "--json", "--no-history")
    time = next(o for o in json.loads(judged.stdout)["objectives"] if o["name"] == "mission_time")
    assert (judged.code, time["status"]) == (1, "fault")
    assert "limit of site.yaml" in time["basis"]
    spoken = care("triage", GOOD, "--json", "--no-history", "--threshold", "mission_time=500")
    assert next(o for o in json.loads(spoken.stdout)["objectives"] if o["name"] == "mission_time")["status"] == "ok"


def test_other_profiles_and_remarks_of_a_site_file_stay(care: Care, tmp_path: Path) -> None:
    out = tmp_path / "site.yaml"
    out.write_text('# ours\nschema: care.site/1\nlimits:\n  rig:\n    time: {op: "<=", value: 3}  # agreed\n', "utf-8")
    assert care("baseline", GOOD, "--out", out).code == 0
    text = out.read_text(encoding="utf-8")
    assert "# ours" in text
    assert "# agreed" in text
    assert "arducopter:" in text


@pytest.mark.parametrize("text", ["limits: [", "name: another thing\n"])
def test_a_file_that_is_no_site_file_is_kept(care: Care, tmp_path: Path, text: str) -> None:
    out = tmp_path / "site.yaml"
    out.write_text(text, encoding="utf-8")
    assert care("baseline", GOOD, "--out", out).code == 2
    assert out.read_text(encoding="utf-8") == text


def test_json_of_the_name_is_the_document(care: Care, tmp_path: Path) -> None:
    out = tmp_path / "limits.json"
    assert care("baseline", GOOD, "--out", out).code == 0
    assert json.loads(out.read_text(encoding="utf-8"))["schema"] == "care.baseline/1"

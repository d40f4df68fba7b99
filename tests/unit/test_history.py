"""The history: what is remembered, by several processes at once, and what a broken store costs (a sentence)."""

from __future__ import annotations

import json
import os
import shutil
import sqlite3
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_core.errors import CareError
from care_core.history.store import History, HistoryError, Verified, history_path
from care_core.history.track_record import sparkline, track_record, trends, write_record
from care_core.report.document import build_document, remembered_verdict
from care_core.report.history import HistoryDocument, history_document, history_text
from care_core.report.reading import document_of
from care_core.report.writers import published
from tests.conftest import Care
from tests.made import made_diagnosis

ROOT = Path(__file__).parents[2]
SAMPLE = ROOT / "samples/arducopter_failed.BIN"
DOCUMENT = published(build_document(made_diagnosis()))


def triage_of(number: int) -> dict[str, object]:
    return {**DOCUMENT, "log": {**DOCUMENT["log"], "sha256": f"{number:064d}", "path": f"/logs/{number}.BIN"}}


def verification_of(number: int, p_fixed: float, worked: bool | None) -> dict[str, object]:
    return {
        "profile": DOCUMENT["profile"],
        "report_log": {"sha256": f"{number:064d}"},
        "log": {"sha256": f"{number + 1:064d}"},
        "p_fixed": p_fixed,
        "worked": worked,
    }


@pytest.fixture
def history(tmp_path: Path) -> History:
    return History(tmp_path / "deep" / "history.sqlite3")


def test_an_empty_history_is_no_error(history: History) -> None:
    assert history.triages() == ()
    assert history.verifications() == ()
    assert "No triage" in history_text(history_document((), ()))


def test_what_promised_nothing_is_no_promise(history: History) -> None:
    history.add_verification({**verification_of(1, 0.5, True), "p_fixed": None})
    assert history.verifications() == ()


def test_the_same_log_is_remembered_once(history: History) -> None:
    for number in (1, 2, 1):
        history.add_triage(triage_of(number), 1)
    history.add_triage(triage_of(1), 2)
    found = history.triages()
    assert [(Path(one.log_path).name, one.mission) for one in found] == [("1.BIN", 2), ("1.BIN", 1), ("2.BIN", 1)]
    assert len(history.triages(limit=2)) == 2
    assert history.triages(profile="another") == ()
    assert found[0].document == triage_of(1)


def _add(path: Path, start: int) -> None:
    for number in range(start, start + 5):
        History(path).add_triage(triage_of(number), 1)


def test_the_runs_of_a_robot_are_found_by_an_index(history: History) -> None:
    """Without one every document in the file is read for the few runs of this robot."""
    history.add_triage(DOCUMENT, 1)
    with sqlite3.connect(history.path) as connection:
        ((*_, how),) = connection.execute(
            "explain query plan select id from triages where robot = 'a' order by id desc"
        )
    assert "INDEX triages_robot" in how


def test_processes_that_write_at_once_lose_nothing(history: History) -> None:
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        list(pool.map(_add, [history.path] * 4, (0, 100, 200, 300)))
    assert len(history.triages()) == 20


@pytest.mark.parametrize(
    "content", [b"no database at all, but long enough to be read", b"SQLite format 3\x00" + b"\xff" * 200]
)
def test_a_corrupt_store_is_said_in_a_sentence(history: History, content: bytes) -> None:
    history.path.parent.mkdir()
    history.path.write_bytes(content)
    with pytest.raises(HistoryError, match="cannot be used"):
        history.add_triage(triage_of(1), 1)
    with pytest.raises(HistoryError, match="cannot be used"):
        history.triages()
    assert history.path.read_bytes() == content


def test_a_store_of_a_later_version_is_left_alone(history: History) -> None:
    history.add_triage(triage_of(1), 1)
    with sqlite3.connect(history.path) as connection:
        connection.execute("pragma user_version = 99")
    with pytest.raises(HistoryError, match="later version"):
        history.triages()


def test_a_damaged_record_is_said_in_a_sentence(history: History) -> None:
    history.add_triage(triage_of(1), 1)
    for broken in ("{", "[]", "{}"):
        with sqlite3.connect(history.path) as connection:
            connection.execute("update triages set document = ?", (broken,))
        with pytest.raises(HistoryError):
            history_document(history.triages(), ())


def test_where_the_store_is(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("CARE_HISTORY", raising=False)
    path = history_path()
    assert path is not None
    assert path.is_relative_to(os.environ["HOME"])
    monkeypatch.setenv("CARE_HISTORY", str(tmp_path / "x"))
    assert history_path() == tmp_path / "x"
    monkeypatch.setenv("CARE_HISTORY", "Off")
    assert history_path() is None


# What the past says


@given(st.lists(st.tuples(st.floats(0, 1), st.sampled_from([True, False, None]))))
def test_every_settled_promise_is_counted_once(outcomes: list[tuple[float, bool | None]]) -> None:
    record = track_record([Verified("t", "p", "1", p, worked, {}) for p, worked in outcomes])
    settled = [(p, worked) for p, worked in outcomes if worked is not None]
    assert record.count == len(settled) == sum(one.count for one in record.bins)
    assert record.worked == sum(worked for _, worked in settled) == sum(one.worked for one in record.bins)
    assert record.expected == pytest.approx(sum(p for p, _ in settled))
    assert all(one.low <= one.promised + 1e-12 and one.promised <= one.high + 1e-12 for one in record.bins)


@given(st.lists(st.floats(-1e9, 1e9), max_size=40), st.booleans())
def test_a_sparkline_has_a_mark_a_value(values: list[float], ascii: bool) -> None:
    line = sparkline(values, ascii=ascii)
    assert len(line) == len(values)
    assert line.isascii() or not ascii
    if values and max(values) > min(values):
        marks = "_.-~=*#@" if ascii else "▁▂▃▄▅▆▇█"
        assert line[values.index(max(values))] == marks[-1]
        assert line[values.index(min(values))] == marks[0]


def test_trends_run_from_the_oldest(history: History) -> None:
    for number, value in enumerate((190.0, 120.0, None)):
        document = json.loads(json.dumps(triage_of(number)))
        document["objectives"][1]["value"] = value
        history.add_triage(document, 1)
    assert trends(history.triages())["mission_time"] == (190.0, 120.0)


def test_the_document_fits_its_schema_and_the_text_is_clean(history: History) -> None:
    history.add_triage({**triage_of(1), "log": {**triage_of(1)["log"], "path": "/a/\x1b[31m.BIN"}}, 1)  # type: ignore[dict-item]
    history.add_verification(verification_of(1, 0.9, True))
    document = history_document(history.triages(), history.verifications())
    jsonschema.validate(json.loads(document.to_json()), HistoryDocument.json_schema())
    text = history_text(document)
    assert "\x1b" not in text
    assert "verified fixes: 1, worked 1, promised 0.9" in text
    assert history_text(document, ascii=True).isascii()


NAMED = {
    "kind": "crash", "title": "it hit the \x1bground", "onset_s": 9.0, "end_s": 9.0, "severity": "critical",
    "after_impact": False, "evidence": "", "source": "ERR", "consequences": [],
}  # fmt: skip


@pytest.mark.parametrize(
    ("statuses", "more", "verdict"),
    [
        (["ok", "ok"], {}, "OK: all objectives are within their thresholds"),
        (["ok", "ok"], {"findings": [NAMED]}, "FAULT: it hit the \\x1bground at 9.0 s"),
        (["ok", "fault"], {"findings": [NAMED]}, "FAULT: o1 not met"),
        (["ok", "not_evaluated"], {}, "NOT EVALUATED: o1 could not be evaluated; no fault was found"),
        ([], {}, "NOT EVALUATED: nothing could be judged"),
        (["not_evaluated"], {"fit": {"verdict": "no", "reasons": []}}, "NOT EVALUATED: no goals are recorded"),
        (["ok"], {"findings": [{**NAMED, "severity": "info"}]}, "OK: all objectives are within their thresholds"),
    ],
)
def test_only_a_run_without_any_fault_is_remembered_as_fine(
    statuses: list[str], more: dict[str, Any], verdict: str
) -> None:
    objectives = [
        {"name": f"o{place}", "value": None, "unit": "", "kind": "functional", "threshold": None, "status": status,
         "reason": None}
        for place, status in enumerate(statuses)
    ]  # fmt: skip
    fits = {"verdict": "fits", "reasons": []}
    document = {**DOCUMENT, "fit": fits, "objectives": objectives, "findings": [], "fix": None, **more}
    assert remembered_verdict(document_of(document)).headline.startswith(verdict)


def test_verified_fixes_have_a_file_of_their_own_and_the_profile_stays_sound(
    history: History, tmp_path: Path, care: Care
) -> None:
    shutil.copytree(ROOT / "profiles" / "husky-care", tmp_path / "husky")
    for number, (p, worked) in enumerate(((0.9, True), (0.85, True), (0.5, False), (0.7, None))):
        history.add_verification(verification_of(number, p, worked))
    text = write_record(tmp_path / "husky", track_record(history.verifications())).read_text(encoding="utf-8")
    assert "Of 3 fixes that were made and verified after the next run, 2 worked; the probabilities promised 2.2" in text
    assert care("profiles", "check", tmp_path / "husky").code == 0
    with pytest.raises(CareError):
        write_record(tmp_path / "none", track_record(()))


# Commands


def test_triage_remembers_unless_told_not_to(care: Care, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = tmp_path / "h.sqlite3"
    monkeypatch.setenv("CARE_HISTORY", str(store))
    assert care("triage", SAMPLE, "--no-history").code == 1
    assert not store.exists()
    assert care("triage", SAMPLE).code == 1
    code, out, _ = care("history")
    assert code == 0
    assert "arducopter_failed.BIN" in out
    assert "LAND_SPEED" in out
    assert json.loads(care("history", "--json").stdout)["triages"][0]["options"] == ["LAND_SPEED"]
    assert "verified fixes: none yet" in care("profiles", "show", "arducopter").stdout


def test_a_store_that_cannot_be_used_never_stops_a_triage(
    care: Care, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for place in (tmp_path / "file" / "h", tmp_path / "file"):
        (tmp_path / "file").write_text("not a database, not a folder", encoding="utf-8")
        monkeypatch.setenv("CARE_HISTORY", str(place))
        code, out, err = care("triage", SAMPLE)
        assert code == 1
        assert "LAND_SPEED" in out
        assert err.count("The history cannot be used") == 1
    assert care("history").code == 2
    monkeypatch.setenv("CARE_HISTORY", "off")
    code, _, err = care("triage", SAMPLE)
    assert code == 1
    assert "history" not in err
    assert care("history").code == 2

"""Two runs side by side: what was set otherwise, what differs first, what came of it; in every format."""

from __future__ import annotations

import json
import re
from pathlib import Path

import jsonschema
import numpy as np
import pytest

import care_core
from care_core.application import comparing
from care_core.application.comparing import Compared, _departure
from care_core.application.sharing import Sharing
from care_core.errors import UsageError
from care_core.report.comparison import (
    CompareDocument,
    EventPairEntry,
    compare_document,
    comparison_markdown,
    sections_of,
)
from care_core.report.html import comparison_html
from tests.conftest import Care

ROOT = Path(__file__).parents[2]
GOOD, FAILED = ROOT / "tests" / "data" / "arducopter_good.BIN", ROOT / "samples" / "arducopter_failed.BIN"
GOOD_DRIVE, FAILED_DRIVE = ROOT / "tests" / "data" / "move_base_good.bag", ROOT / "samples" / "move_base_drive.bag"


@pytest.fixture(scope="module")
def flights() -> Compared:
    return care_core.compare(GOOD, FAILED)


@pytest.fixture(scope="module")
def drives() -> Compared:
    return care_core.compare(GOOD_DRIVE, FAILED_DRIVE)


def test_parameters_objectives_and_measures_stand_side_by_side(flights: Compared) -> None:
    document = compare_document(flights.comparison())
    assert {"LAND_SPEED"} <= {one.parameter for one in document.parameters}
    time = next(one for one in document.objectives if one.name == "mission_time")
    assert (time.a and time.a.status, time.b and time.b.status) == ("ok", "fault")
    assert document.measures[0].name == "landing_time"
    assert document.measures[0].distance is not None
    assert document.measures[0].distance > 10
    assert (document.a.status, document.b.status) == ("ok", "fault")
    assert document.warnings == []


def test_events_are_counted_from_the_start_of_each_mission_and_paired(flights: Compared) -> None:
    events = {one.what: one for one in compare_document(flights.comparison()).events}
    landed = events["landed"]
    assert landed.a_s == pytest.approx(78.9, abs=0.5)
    assert landed.b_s == pytest.approx(164.2, abs=0.5)
    assert landed.differs
    assert not events["took off"].differs


def test_what_differs_first_is_said(drives: Compared) -> None:
    document = compare_document(drives.comparison())
    assert re.match(r"at \d\.\d s speed forward .* goes apart: 0\.49\d* m/s in A", document.first)
    goals = [one for one in document.events if one.what.startswith("goal")]
    assert [one.what.partition(" at")[0] for one in goals] == [f"goal {n}" for n in range(1, 6)]
    assert all(one.a_s is not None and one.b_s is not None and one.a_s < one.b_s for one in goals)


def test_what_a_goal_came_to_is_said_where_that_differs() -> None:
    good, failed = (ROOT / "samples" / f"nav2_{name}.mcap" for name in ("good", "failed"))
    document = compare_document(care_core.compare(good, failed).comparison())
    assert document.first == "goal 1, reached in A, cancelled in B: at 15.9 s in A, at 60.2 s in B"
    assert any(one.what.endswith("...") for one in document.events), "a message that was cut says so"


def test_signals_that_were_never_together_or_only_rustle_go_not_apart() -> None:
    t = np.arange(0.0, 60.0, 0.1)
    flat = np.zeros_like(t)
    assert _departure((t, flat + 60.0), (t, flat + 584.0), 20.0) is None, "heights above two homes"
    assert _departure((t, flat), (t, np.where(t > 20.0, 0.08, 0.0)), 2.0) is None
    at_s, one, other = _departure((t, flat), (t, np.where(t > 20.0, 9.0, 0.0)), 2.0) or (0.0, 0.0, 0.0)
    assert at_s == pytest.approx(20.0, abs=2.0)
    assert one == 0.0 < other


def test_a_run_beside_itself_differs_in_nothing(flights: Compared) -> None:
    document = compare_document(Compared(flights.b, flights.b).comparison())
    assert document.warnings == ["both are the same run"]
    assert (document.first, document.parameters, document.departures, document.measures) == ("", [], [], [])
    assert not any(one.differs for one in document.events)


def test_runs_of_different_missions_and_profiles_are_said_to_be(flights: Compared, drives: Compared) -> None:
    motor = compare_document(care_core.compare(GOOD, ROOT / "samples" / "arducopter_motor.BIN").comparison())
    assert any(one.startswith("the missions differ: legs 5 in A, 3 in B") for one in motor.warnings)
    assert motor.findings[0].title == "motor 4 (rear) lost thrust"
    assert motor.findings[0].a_s is None
    other = compare_document(Compared(flights.a, drives.b).comparison())
    assert any("A was judged by arducopter, B by move_base" in one for one in other.warnings)
    assert other.measures == []


def test_a_flight_and_a_drive_are_not_compared(care: Care) -> None:
    with pytest.raises(UsageError, match=r"the log of a copter under ArduPilot, and this one is of a robot under ROS"):
        care_core.compare(GOOD, FAILED_DRIVE)
    refused = care("compare", GOOD, FAILED_DRIVE)
    assert (refused.code, refused.stdout) == (2, "")
    assert "Name two runs of the same robot." in refused.stderr


def test_the_page_draws_the_signals_of_both_over_each_other(flights: Compared, drives: Compared) -> None:
    for case in (flights, drives):
        page = case.report("html")
        assert page.count('<span class="key line1">A</span><span class="key line2">B</span>'.replace("><", ">\n<")) >= 2
        assert "<script" not in page
        assert "http" not in page.partition("</head>")[2]


def test_the_file_chooses_the_format_and_is_replaced_by_its_like(
    care: Care, tmp_path: Path, drives: Compared, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(comparing, "compare", lambda *_: drives)
    for suffix, begins in ((".html", "<!doctype html>"), (".md", "# Comparison of "), (".json", "{"), (".txt", "A ")):
        out = tmp_path / f"both{suffix}"
        for _ in range(2):
            assert care("compare", GOOD_DRIVE, FAILED_DRIVE, "--out", out).code == 1, "as triage of B ends"
        assert out.read_text(encoding="utf-8").startswith(begins)


def test_the_command_prints_lines_of_80_columns_and_a_document_of_its_schema(care: Care) -> None:
    outcome = care("compare", FAILED_DRIVE, GOOD_DRIVE)
    assert outcome.code == 0
    assert all(len(line) <= 80 for line in outcome.stdout.splitlines())
    document = json.loads(care("compare", GOOD_DRIVE, FAILED_DRIVE, "--json").stdout)
    jsonschema.validate(document, CompareDocument.json_schema())
    assert json.loads(care("schema", "compare").stdout) == CompareDocument.json_schema()


def test_what_is_sent_has_no_positions_and_anonymous_no_names(flights: Compared) -> None:
    assert "POS Lat" in flights.report("html", Sharing())
    assert "POS Lat" not in flights.report("html")
    anonymous = flights.report("markdown", Sharing(positions=False, anonymous=True))
    assert "arducopter_good" not in anonymous


def test_a_text_of_a_log_is_no_markup(flights: Compared) -> None:
    document = compare_document(flights.comparison())
    document.events[0] = EventPairEntry(what="<b>| `x` [y](http://z)", a_s=1.0, b_s=2.0, differs=False)
    assert r"\<b\>\| \`x\` \[y\](http:\//z)" in comparison_markdown(document)
    assert "&lt;b&gt;" in comparison_html(document)


def test_only_one_format_can_be_printed_and_an_unknown_one_is_named(care: Care, flights: Compared) -> None:
    assert care("compare", GOOD, FAILED, "--json", "--html").code == 2
    with pytest.raises(UsageError, match="no format 'yaml'"):
        flights.report("yaml")


def test_tables_are_cut_for_people_with_what_is_left_out(flights: Compared) -> None:
    measures = next(
        one for one in sections_of(compare_document(flights.comparison())) if one.title.startswith("Measures")
    )
    assert len(measures.rows) + measures.more == len(compare_document(flights.comparison()).measures)
    assert measures.more

"""Markdown for a post: short, without wide tables, and no text of a log is markup, a mention or a link."""

from __future__ import annotations

import re

from care_core.diagnose.records import Since
from care_core.ecosystems.findings import Event, Finding
from care_core.records import replace
from care_core.report.document import build_document
from care_core.report.markdown import LONGEST, to_markdown
from tests.made import made_diagnosis


def test_it_has_no_table_and_folds_the_difference_and_the_account() -> None:
    text = to_markdown(build_document(made_diagnosis()))
    assert not [line for line in text.splitlines() if line.startswith("|")]
    folded = re.findall(r"<details><summary>(.*?)</summary>\n\n(.*?)\n\n</details>", text, re.DOTALL)
    assert [title for title, _ in folded] == ["The difference to the configuration as driven", "What happened"]
    assert folded[0][1].startswith("```diff\n--- as driven")
    assert text.count("```") % 2 == 0


def test_a_text_of_a_log_calls_nobody_and_links_nowhere() -> None:
    made = made_diagnosis()
    said = "@everyone see https://evil.example/x or www.evil.example <img src=x> ![a](b) ```"
    health = replace(made.health, timeline=(Event(1.0, "message", said, "MSG"),))
    text = to_markdown(build_document(replace(made, health=health)))
    assert "@" not in text.replace("@@ -1 +1 @@", "")
    assert "(at)everyone" in text
    assert not re.search(r"https?://|www\.", text)
    assert "\\<img src=x\\>" in text
    assert "\\`\\`\\`" in text


def test_a_difference_with_fences_in_it_stays_a_code_block() -> None:
    report = replace(build_document(made_diagnosis()), diff="--- a\n-````\n+x\n")
    text = to_markdown(report)
    assert "`````diff\n--- a\n-````\n+x\n`````" in text


def test_it_is_never_longer_than_a_post_and_says_what_it_left_out() -> None:
    made = made_diagnosis()
    many = tuple(Finding("gps", f"finding {n}", 1.0, 2.0, "warning", "x" * 2000, "GPS") for n in range(200))
    moments = tuple(Event(float(n), "message", "y" * 2000, "MSG") for n in range(200))
    report = build_document(
        replace(
            made,
            health=replace(made.health, findings=many, timeline=moments),
            since=Since("/a/good.BIN", (), tuple("z" * 900 for _ in range(100))),
            notes=tuple(f"{n} {'n' * 900}" for n in range(100)),
        )
    )
    text = to_markdown(report)
    assert len(text) <= LONGEST + 500
    assert text.startswith("# Triage of a.BIN")
    assert "- and 160 more" in text
    assert "parts are left out here" in text
    assert text.rstrip().endswith("."), "where it comes from stays"


def test_folders_of_the_log_stay_at_home() -> None:
    made = made_diagnosis()
    log = replace(made.run.log, path="/home/zelda/flights/a.BIN")
    assert "zelda" not in to_markdown(build_document(replace(made, run=replace(made.run, log=log))))

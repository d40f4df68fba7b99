"""The HTML report: one file, nothing from elsewhere, and no text of a log that is markup."""

from __future__ import annotations

from html.parser import HTMLParser

from care_core.diagnose.records import Circumstance, Dismissal
from care_core.records import replace
from care_core.report.document import build_document
from care_core.report.html import to_html
from care_core.report.markdown import to_markdown
from care_core.report.writers import to_json
from tests.made import made_diagnosis

HOSTILE = '<script>alert("x")</script> & \x1b[31m'


class Seen(HTMLParser):
    """Tags, attributes, and whether every tag is closed."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.open: list[str] = []
        self.links: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.links += [value or "" for name, value in attrs if name in ("src", "href")]
        if tag not in ("meta", "br"):
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_it_holds_the_answer_and_needs_nothing_else() -> None:
    page = to_html(build_document(made_diagnosis()))
    seen = Seen()
    seen.feed(page)
    assert not seen.open
    assert "script" not in seen.tags
    assert all(link.startswith("#") for link in seen.links)
    for part in ("land_speed", "mission_time", "✗ FAULT", "? NOT EVALUATED", "<ins>+LAND_SPEED,50</ins>", "param set"):
        assert part in page


def test_text_of_the_log_and_of_the_operator_is_escaped() -> None:
    made = made_diagnosis()
    diagnosis = replace(
        made,
        run=replace(made.run, log=replace(made.run.log, path=f"/logs/{HOSTILE}.BIN")),
        notes=(HOSTILE,),
        dismissed=(Dismissal("land_speed", HOSTILE),),
        abstained=HOSTILE,
    )
    page = to_html(build_document(diagnosis))
    assert "<script" not in page
    assert "\x1b" not in page
    assert "&lt;script&gt;" in page


def test_what_was_set_aside_is_in_every_format() -> None:
    report = build_document(replace(made_diagnosis(), dismissed=(Dismissal("land_speed", "slow on purpose"),)))
    for text in (to_json(report), to_markdown(report), to_html(report)):
        assert "slow on purpose" in text


def test_what_is_uncertain_is_in_the_page_too() -> None:
    rival = Circumstance("wind", "wind_lean", 9.0, "deg", 0.0, 6.0, 0.01, f"stronger than in training {HOSTILE}")
    diagnosis = replace(made_diagnosis(), rivals=(rival,), tell_more=("fly it again",))
    page = to_html(build_document(diagnosis))
    assert "<li>wind: stronger than in training &lt;script&gt;" in page
    assert "<li>fly it again</li>" in page

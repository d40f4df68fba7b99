"""What happened in a log: its account and findings, how well the profile fits, and what explains the failure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from textual.content import Content

from care_core.diagnose.records import Diagnosis, Hypothesis
from care_core.ecosystems.findings import Event, Finding, Health, Severity
from care_core.records import Record, replace
from care_core.report.marks import Mark
from care_core.report.wording import SEVERITY_WORDS, noted
from care_core.text import percent, seconds
from care_tui.render.objectives import damage
from care_tui.render.rows import Glyphs, Row, cut, heading, labelled, padded, text, warning

TIME_WIDTH, KIND_WIDTH = 8, 10
_SHORT = {"led to": "led to", "followed by": "then", "seen just before it": "before"}
_COLOURS: dict[Severity, str] = {"critical": "bold $text-error", "warning": "$text-warning", "info": ""}


class FindingRow(Record):
    """A line of the pane: a finding, one that is folded under `cause`, or an event of the timeline."""

    what: Finding | Event
    cause: Finding | None = None
    link: str = ""
    """How it hangs together with that."""

    @property
    def time_s(self) -> float:
        return self.what.onset_s if isinstance(self.what, Finding) else self.what.time_s

    @property
    def words(self) -> str:
        """What `/` searches in."""
        if isinstance(self.what, Finding):
            return f"{self.what.kind} {SEVERITY_WORDS[self.what.severity]} {self.what.title}"
        return f"{self.what.kind} {self.what.text}"


def health_rows(health: Health) -> list[FindingRow]:
    """Findings, the first cause first and what is folded under each below it; then the account in order of time."""
    lines = []
    for finding in noted(health.findings):
        lines.append(FindingRow(finding))
        lines += [FindingRow(below, finding, link) for link, several in finding.links for below in several]
    return [*lines, *(FindingRow(event) for event in health.timeline)]


def health_row_item(one: FindingRow, glyphs: Glyphs) -> Content:
    """One line of the pane. A finding has a sign and a word, what is folded under it is set in, an event is plain."""
    time = f"{seconds(one.time_s):>{TIME_WIDTH}}  "
    if isinstance(one.what, Event):
        kind = padded(one.what.kind, KIND_WIDTH)
        # A kind that is wider than its column takes of the blanks before the time.
        narrower = f"{seconds(one.time_s):>{max(TIME_WIDTH + KIND_WIDTH - kind.cell_length, 0)}}  "
        return Content.assemble("  ", kind, narrower, text(one.what.text))
    late = "  (after it was down)" if one.what.after_impact else ""
    if one.cause is not None:
        return Content.assemble(
            f"  {glyphs.to} ", padded(_SHORT[one.link], KIND_WIDTH - 2), time, text(one.what.title + late)
        )
    sign = {"critical": glyphs.fault, "warning": "!", "info": " "}[one.what.severity]
    head = padded(f"{sign} {SEVERITY_WORDS[one.what.severity]}", KIND_WIDTH + 2, _COLOURS[one.what.severity])
    return Content.assemble(head, time, text(one.what.title, "bold"), text(late))


def happened_rows(lines: Iterable[FindingRow], width: int, glyphs: Glyphs) -> list[Row]:
    """What happened as part of a text, a line each; nothing where nothing did."""
    items = [Row(cut(health_row_item(line, glyphs), width, glyphs)) for line in lines]
    return [Row(Content()), heading("What happened"), *items] if items else []


def health_row_details(one: FindingRow) -> list[Row]:
    """All about one line of the pane."""
    if isinstance(one.what, Event):
        return [labelled(seconds(one.what.time_s), one.what.text), labelled("From", one.what.source)]
    return finding_rows(one.what, one.cause, one.link)


def finding_rows(finding: Finding, cause: Finding | None = None, link: str = "") -> list[Row]:
    """A finding with its numbers, where they come from, and what is folded under it."""
    span = seconds(finding.onset_s)
    if finding.end_s > finding.onset_s:
        span += f" to {seconds(finding.end_s)}"
    rows = [heading(finding.title), labelled("When", span + (", after it was down" if finding.after_impact else ""))]
    rows += [labelled("Seen by", finding.evidence)] if finding.evidence else []
    rows += [labelled("From", finding.source)] if finding.source else []
    if cause is not None:
        how = "Explained by" if link == "led to" else "Seen with"
        rows.append(labelled(how, f"{cause.title} ({seconds(cause.onset_s)})"))
    rows += [
        labelled(
            "" if place else f"It {words}" if words == "led to" else words.capitalize(),
            f"{below.title} ({seconds(below.onset_s)})",
        )
        for words, several in finding.links
        for place, below in enumerate(several)
    ]
    return rows


def warnings_of(diagnosis: Diagnosis) -> list[str]:
    """What limits the answer, beside the fit of the profile; the gravest first."""
    run = diagnosis.run
    found = [] if run.mission.ended else ["the log stops before the mission does"]
    found += [run.mission.mismatch] if run.mission.mismatch else []
    found += [damage(part) for part in run.log.damage]
    return found


_SIGNS = {
    "crash": "C",
    "failsafe": "F",
    "error": "E",
    "mode": "M",
    "goal": "G",
    "recovery": "R",
    "parameter": "P",
    "info": "i",
}
_SIGNS_OF_WORDS = {"armed": "A", "disarmed": "D", "took off": "T", "highest": "H", "landed": "L"}
"""Of moments of one kind that are each other's opposites, by how they begin."""


def sign_of(mark: Mark, glyphs: Glyphs) -> str:
    """What happened as a sign on the axis of time."""
    if mark.kind in ("arming", "flight"):
        return next((sign for words, sign in _SIGNS_OF_WORDS.items() if mark.words.startswith(words)), "!")
    return glyphs.fault if mark.kind == "critical" else _SIGNS.get(mark.kind, "!")


def fit_rows(diagnosis: Diagnosis, advice: Sequence[str]) -> list[Row]:
    """What keeps every profile from fitting, and what would make one fit; nothing where one does."""
    fit = diagnosis.profile.fit
    if fit.verdict != "no":
        return []
    rows = [heading("No profile fits this log"), *(Row(text(f"- {reason}"), 2) for reason in fit.reasons)]
    return rows + (
        [heading("What would make one fit"), *(Row(text(f"- {one}"), 2) for one in advice)] if advice else []
    )


def hypothesis_rows(one: Hypothesis, finding: Finding | None, notes: Sequence[str] = ()) -> list[Row]:
    """All about an explanation but how its finding was seen, which stands before it, with the notes that name it."""
    rows = [] if finding is None else [*finding_rows(replace(finding, evidence="")), Row(Content())]
    if one.what in ("hardware", "world"):
        rows.append(warning("Not a parameter", "if this is the cause, changing parameters will not help"))
    said = [warning("Note", note) for note in notes if one.what == "parameter" and one.name and one.name in note]
    return [labelled("Probability", percent(one.probability)), *said, *rows]

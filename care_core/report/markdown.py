"""The report as a post in a forum or a ticket: short enough for either, no wide tables, the long parts folded.

Discourse takes 32,000 characters, GitHub 65,536. Names of files stand without their folders. A text of a log makes no
markup, notifies nobody and becomes no link.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from care_core.diagnose.verdict import STATUS_WORDS
from care_core.report.document import (
    CauseEntry,
    FixEntry,
    ObjectiveEntry,
    Report,
    SinceEntry,
)
from care_core.report.health import finding_sentence
from care_core.report.shared_causes import together
from care_core.report.wording import SEVERITY_WORDS, below, noted
from care_core.run import shown
from care_core.text import listed, log_time

LONGEST = 30_000
"""Characters of a post."""
_MOST_LINES, _MOST_CHARACTERS = 40, 500
"""Lines of a list, and characters of a line; more is said to be left out."""
_SPECIAL = re.compile(r"([\\`*_{}\[\]<>#|~])")
_LINKS = re.compile(r"(?<=:)(?=//)|(?<=www)(?=\.)", re.IGNORECASE)


def to_markdown(report: Report) -> str:
    """A report to paste into a ticket. Where it would be too long, its last parts are left out, and that is said."""
    first, *rest = (list(section) for section in _sections(report))
    kept, left_out = [first, rest.pop()], 0
    length = sum(len(line) + 1 for section in kept for line in section)
    for section in rest:
        length += sum(len(line) + 1 for line in section)
        if length > LONGEST:
            left_out += 1
        else:
            kept.insert(-1, section)
    if left_out:
        kept.insert(-1, ["", f"*{left_out} parts are left out here; the HTML report holds them.*"])
    return "\n".join(line for section in kept for line in section) + "\n"


def _sections(report: Report) -> Iterator[Iterable[str]]:
    """The parts in their order; the first and the last are always there."""
    yield _head(report)
    yield _listed("What explains it", map(str, report.verdict.reasons))
    told = (f"{SEVERITY_WORDS[one.severity]}: {finding_sentence(one)}" for one in noted(report.findings))
    yield _listed("Findings, the first cause first", told)
    yield _objectives(report.objectives)
    for faults in together(report.faults, lambda fault: [cause.path for cause in fault.causes]):
        yield _causes([one.objective for one in faults], *report.told(faults[-1]), report.odds_as_driven)
    if report.fix is not None:
        yield _fix(report, report.fix)
    if report.since is not None:
        yield _since(report.since)
    yield _listed("It may not be a parameter", (f"{one.circumstance}: {one.text}" for one in report.rivals))
    yield _listed("How to find out more", report.tell_more)
    yield _listed("Set aside by the operator", (f"{one.option}: {one.reason}" for one in report.dismissed))
    yield _listed("Notes", report.notes)
    yield _account(report)
    yield _origin(report)


def _head(report: Report) -> Iterator[str]:
    yield f"# Triage of {escaped(Path(report.log.path).name)}"
    verdict = report.verdict
    for line in (f"**{verdict.word}**{escaped(verdict.told)}", *map(escaped, verdict.lines[1:])):
        yield from ("", f"{line}.")


def _objectives(objectives: Iterable[ObjectiveEntry]) -> Iterator[str]:
    lines = [_objective(one) for one in objectives]
    if lines:
        yield from ("", "## Objectives", "", *lines)


def _objective(one: ObjectiveEntry) -> str:
    parts = [f"- {STATUS_WORDS[one.status]} `{one.name}`"]
    if one.measured:
        parts.append(f" {one.measured}")
    wanted = one.wanted
    parts += [f", wanted {escaped(wanted)}"] if wanted else []
    parts += [f": {escaped(one.reason)}"] if one.reason else []
    return "".join(parts)


def _causes(names: list[str], causes: list[CauseEntry], unlikely: list[str], as_driven: float | None) -> Iterator[str]:
    yield from ("", f"## Causes of {listed([f'`{name}`' for name in names])}", "")
    lines = [line for cause in causes for line in _cause(cause, as_driven)]
    if unlikely:
        lines += [*([""] if lines else []), below([f"`{name}`" for name in unlikely], after=len(causes))]
    yield from lines or ["None of the profile's parameters is likely."]


def _cause(cause: CauseEntry, as_driven: float | None) -> Iterator[str]:
    yield f"{cause.rank}. **`{cause.option}`** {cause.change} ({cause.worth(as_driven)})"
    yield f"   {' → '.join(cause.path)}"


def _fix(report: Report, fix: FixEntry) -> Iterator[str]:
    objectives = {objective.name: objective for objective in report.objectives}
    yield from ("", "## Fix", "", *(f"- change {escaped(str(change))}" for change in fix.changes))
    for name, predicted in fix.predicted.items():
        told = filter(None, (objectives[name].prediction(predicted), predicted.odds(fix.guess)))
        yield f"- `{name}` {', '.join(told)}"
    yield from _folded("The difference to the configuration as driven", report.diff.rstrip("\n"), "diff")
    yield from ("", *_fenced("\n".join(report.apply), "sh"))
    if fix.alternatives:
        yield from ("", "Or:", "")
        yield from (f"- {escaped(other.sentence(report.odds_as_driven))}" for other in fix.alternatives)


def _since(since: SinceEntry) -> Iterator[str]:
    yield from ("", f"## Changed since {code(Path(since.log).name)}", "")
    lines = [f"- {escaped(warning)}" for warning in since.warnings]
    for change in since.changes:
        option = f" ({change.option})" if change.option and change.option != change.parameter else ""
        values = f"{escaped(shown(change.from_))} → {escaped(shown(change.to))}"
        lines.append(f"- {code(change.parameter)}{option}: {values}")
    yield from _at_most(lines)
    if not since.changes:
        yield "No parameter that anybody sets."


def _account(report: Report) -> Iterator[str]:
    if report.account:
        yield from ("", "<details><summary>What happened</summary>", "")
        yield from _at_most([f"- {log_time(one.time_s)}: {_clipped(one.text)}" for one in report.account])
        yield from ("", "</details>")


def _origin(report: Report) -> Iterator[str]:
    log, profile = report.log, report.profile
    sha256 = f", SHA-256 `{log.sha256}`" if log.sha256 else ""
    yield from ("", f"Log {code(Path(log.path).name)}, {log.format}, {log_time(log.duration_s, 0)}{sha256}.")
    if profile is not None:
        yield escaped(f"Profile {profile.title} {profile.version} ({profile.platform}).")
    for damage in log.damage[:5]:
        yield f"Damage: {_clipped(damage.what)}."
    if len(log.damage) > 5:
        yield f"Damage: {len(log.damage) - 5} more places."


def _listed(title: str, sentences: Iterable[str]) -> Iterator[str]:
    lines = [f"- {_clipped(sentence)}" for sentence in sentences]
    if lines:
        yield from ("", f"## {title}", "", *_at_most(lines))


def _at_most(lines: list[str]) -> Iterator[str]:
    yield from lines[:_MOST_LINES]
    if len(lines) > _MOST_LINES:
        yield f"- and {len(lines) - _MOST_LINES} more"


def _clipped(text: str) -> str:
    return escaped(text if len(text) <= _MOST_CHARACTERS else f"{text[: _MOST_CHARACTERS - 4]} ...")


def _folded(title: str, text: str, language: str) -> Iterator[str]:
    """A code block that opens on a click; both forums want empty lines inside."""
    yield from ("", f"<details><summary>{title}</summary>", "", *_fenced(text, language), "", "</details>")


def _fenced(text: str, language: str) -> Iterator[str]:
    """A code block; its fence is longer than any run of backticks inside."""
    fence = "`" * max(3, 1 + _longest_run(text))
    yield from (f"{fence}{language}", text, fence)


def escaped(text: str) -> str:
    """A text that is no markup, calls nobody by name and becomes no link."""
    return _LINKS.sub(r"\\", _SPECIAL.sub(r"\\\1", text)).replace("@", "(at)")


def code(text: str) -> str:
    """A code span: nothing in it is escaped, so its fence is longer than any run of backticks inside."""
    fence = "`" * (1 + _longest_run(text))
    pad = " " if "`" in text else ""
    return f"{fence}{pad}{text}{pad}{fence}"


def _longest_run(text: str) -> int:
    return max(map(len, re.findall("`+", text)), default=0)

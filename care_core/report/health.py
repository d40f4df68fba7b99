"""What happened, as text: the events, the findings, and what explains the failure."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import TypeVar

from care_core.diagnose.verdict import UNKNOWN_PARAMETER, Reason
from care_core.ecosystems.findings import NO_TASK, Event, Finding
from care_core.report.entries import EventEntry, FindingEntry
from care_core.report.wording import SEVERITY_WORDS, noted
from care_core.text import log_time, log_times, wrapped

EVENTS_SHOWN = 24
"""Lines of the account in text; the document holds all."""
LED_TO_SHOWN = 4
REASONS_SHOWN = 4

_CITED = re.compile(r"\b(?:at|from) (\d+\.\d s(?: \(\d+:\d\d\))?)")
"""A time as evidence tells it."""
_QUOTED = re.compile(r'[A-Z]+ "(?P<text>.+)"')

E = TypeVar("E", bound="Event | EventEntry")


def finding_sentence(finding: FindingEntry) -> str:
    """A finding of a document with its numbers and what is folded under it."""
    late = ", after it was down" if finding.after_impact else ""
    led = "".join(f" {words.capitalize()}: {'; '.join(one.title for one in below)}." for words, below in finding.links)
    shown_by = _beyond_title(finding).rstrip(".")
    return f"{finding.title}, at {log_time(finding.onset_s)}{late}.{f' {shown_by}.' if shown_by else ''}{led}"


def timeline_lines(
    account: Sequence[Event | EventEntry],
    findings: Sequence[Finding | FindingEntry] = (),
    robot: str = "",
    most: int = EVENTS_SHOWN,
) -> Iterator[str]:
    """The account as text; of a long one the lines that say most about a failure, and those that findings cite."""
    if not account:
        return
    is_named = not robot or account[0].kind == "vehicle"
    yield from wrapped("What happened" if is_named else f"What happened ({robot})")
    told = telling(account, most, findings)
    for time, moment in zip(log_times([one.time_s for one in told]), told, strict=True):
        yield from wrapped(moment.text, f"  {time:>9}  ")
    if len(told) < len(account):
        yield f"  and {len(account) - len(told)} more: 'care inspect' tells all"


_TELLING = ("vehicle", "crash", "failsafe", "error", "flight", "arming", "goal", "damage", "mode", "recovery",
            "battery", "gps", "message")  # fmt: skip


def telling(account: Sequence[E], most: int, findings: Sequence[Finding | FindingEntry] = ()) -> list[E]:
    """At most so many moments, in order of time: those that the evidence of a finding tells the time of, then those of
    the kinds that say most about a failure."""
    if len(account) <= most:
        return list(account)
    order = {kind: place for place, kind in enumerate(_TELLING)}
    cited = {time for finding in findings for time in _CITED.findall(finding.evidence)}

    def weight(at: int) -> tuple[bool, int, int]:
        event = account[at]
        return log_time(event.time_s) not in cited, order.get(event.kind, len(order)), at

    return [account[at] for at in sorted(sorted(range(len(account)), key=weight)[:most])]


def finding_lines(
    findings: Sequence[Finding | FindingEntry], account: Sequence[Event | EventEntry] = ()
) -> Iterator[str]:
    """The findings as text, what belongs to another under it; that nothing was found is said plainly."""
    shown = noted(findings)
    if any(one.title != NO_TASK for one in findings) and not shown:
        return
    if not shown:
        told = "; the errors that it reported stand below" if any(one.kind == "error" for one in account) else ""
        yield from wrapped(f"no health problems found in what this log records{told}", "Findings: ", "  ")
        return
    yield "Findings" if len(shown) == 1 else "Findings, the first cause first"
    for finding in shown:
        late = ", after it was down" if finding.after_impact else ""
        head = f"  {SEVERITY_WORDS[finding.severity]:<8}  "
        yield from wrapped(f"{finding.title}, at {log_time(finding.onset_s)}{late}", head)
        if shown_by := _beyond_title(finding):
            yield from wrapped(shown_by, " " * len(head))
        yield from _folded(finding, " " * len(head))


def _beyond_title(finding: Finding | FindingEntry) -> str:
    """What shows it, without what its title says already: a refusal, or a message, is its own evidence."""
    quoted = _QUOTED.fullmatch(finding.evidence)
    if quoted and finding.title.endswith(quoted["text"]):
        return ""
    first, _, rest = finding.evidence.partition("; ")
    return rest if finding.title.endswith(f": {first}") else finding.evidence


def _folded(finding: Finding | FindingEntry, indent: str) -> Iterator[str]:
    for words, below in finding.links:
        gravest = sorted(below, key=lambda one: one.severity != "critical")[:LED_TO_SHOWN]
        titles = dict.fromkeys(f"{one.title} ({log_time(one.onset_s)})" for one in below if one in gravest)
        more = f" and {len(below) - LED_TO_SHOWN} more" if len(below) > LED_TO_SHOWN else ""
        yield from wrapped(f"{words}: {'; '.join(titles)}{more}", indent)


def reason_lines(reasons: Sequence[Reason]) -> Iterator[str]:
    """What explains the failure, the likeliest first."""
    if reasons:
        yield "What explains it"
    for one in reasons[:REASONS_SHOWN]:
        yield from wrapped(one.text, f"  {one.probability:>4.0%}  ")
    if more := [one for one in reasons[REASONS_SHOWN:] if one.is_parameter]:
        yield from wrapped(f"less likely: {', '.join(one.name or UNKNOWN_PARAMETER for one in more)}", " " * 8)

"""What happened, in documents and in text: the account, the findings, the fit of the profile, and the hypotheses.

The entries are parts of `care.triage/1` and `care.inspect/1`, alike in both.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TypeVar

from care_core.diagnose.records import Hypothesis, What
from care_core.ecosystems.findings import Event, Finding, FindingKind, Health, Severity
from care_core.numbers import six_digits
from care_core.report.published import Document
from care_core.report.wording import SEVERITY_WORDS, hypothesis_text, noted
from care_core.run import Fit, FitVerdict
from care_core.text import clean, seconds, wrapped

MOMENTS_SHOWN = 24
"""Lines of the account in text; the document holds all."""
LED_TO_SHOWN = 4
HYPOTHESES_SHOWN = 4


M = TypeVar("M", bound="Event | MomentEntry")


class FitEntry(Document, kw_only=True):
    """How well the profile fits the log; `reasons` say what is missing or differs."""

    verdict: FitVerdict
    reasons: list[str]


class MomentEntry(Document, kw_only=True):
    """A line of the account; `time_s` counts from the start of the log, null where its source has no time."""

    time_s: float | None
    kind: str
    text: str
    source: str


class ConsequenceEntry(Document, kw_only=True):
    """A later finding that an earlier one explains."""

    kind: FindingKind
    title: str
    onset_s: float | None
    severity: Severity


class FindingEntry(Document, kw_only=True):
    """Something that was not as it should be; what it explains is folded under it."""

    kind: FindingKind
    title: str
    onset_s: float | None
    end_s: float | None
    severity: Severity
    after_impact: bool
    evidence: str
    source: str
    consequences: list[ConsequenceEntry]


class HypothesisEntry(Document, kw_only=True):
    """One explanation of the failure; their probabilities add up to 1. A parameter is named by its option."""

    what: What
    name: str
    probability: float


def fit_entry(fit: Fit) -> FitEntry:
    return FitEntry(verdict=fit.verdict, reasons=[clean(reason) for reason in fit.reasons])


def account_entries(health: Health) -> list[MomentEntry]:
    return [
        MomentEntry(time_s=_finite(one.time_s), kind=one.kind, text=clean(one.text), source=clean(one.source))
        for one in health.timeline
    ]


def finding_entries(health: Health) -> list[FindingEntry]:
    return [
        FindingEntry(
            kind=one.kind,
            title=clean(one.title),
            onset_s=_finite(one.onset_s),
            end_s=_finite(one.end_s),
            severity=one.severity,
            after_impact=one.after_impact,
            evidence=clean(one.evidence),
            source=clean(one.source),
            consequences=[_consequence(below) for below in one.consequences],
        )
        for one in health.findings
    ]


def hypothesis_entries(hypotheses: Sequence[Hypothesis]) -> list[HypothesisEntry]:
    return [HypothesisEntry(what=h.what, name=clean(h.name), probability=six_digits(h.probability)) for h in hypotheses]


def _consequence(finding: Finding) -> ConsequenceEntry:
    onset_s = _finite(finding.onset_s)
    return ConsequenceEntry(kind=finding.kind, title=clean(finding.title), onset_s=onset_s, severity=finding.severity)


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def finding_sentence(finding: FindingEntry) -> str:
    """A finding of a document with its numbers and what it led to."""
    late = ", after it was down" if finding.after_impact else ""
    led = f" Led to: {'; '.join(one.title for one in finding.consequences)}." if finding.consequences else ""
    return f"{finding.title}, at {seconds(finding.onset_s)}{late}. {finding.evidence.rstrip('.')}.{led}"


def finding_text(finding: Finding) -> str:
    return f"{finding.title} at {seconds(finding.onset_s)}"


def account_lines(account: Sequence[Event | MomentEntry], robot: str = "", most: int = MOMENTS_SHOWN) -> Iterator[str]:
    """The account as text; of a long one the lines that say most about a failure."""
    if not account:
        return
    is_named = not robot or account[0].kind == "vehicle"
    yield from wrapped("What happened" if is_named else f"What happened ({robot})")
    told = telling(account, most)
    for moment in told:
        yield from wrapped(moment.text, f"  {seconds(moment.time_s):>9}  ")
    if len(told) < len(account):
        yield f"  and {len(account) - len(told)} more: 'care inspect' tells all"


_TELLING = ("crash", "failsafe", "error", "arming", "goal", "damage", "mode", "recovery", "message")


def telling(account: Sequence[M], most: int) -> list[M]:
    """At most so many moments, in order of time: those of the kinds that say most about a failure stay."""
    if len(account) <= most:
        return list(account)
    order = {kind: place for place, kind in enumerate(_TELLING)}
    ranked = sorted(range(len(account)), key=lambda i: (order.get(account[i].kind, len(order)), i))
    return [account[i] for i in sorted(ranked[:most])]


def finding_lines(findings: Sequence[Finding | FindingEntry]) -> Iterator[str]:
    """The findings as text, consequences under what explains them; that nothing was found is said plainly."""
    shown = noted(findings)
    if findings and not shown:
        return
    if not shown:
        yield "Findings: nothing out of the ordinary, as far as this log lets itself be checked"
        return
    yield "Findings" if len(shown) == 1 else "Findings, the first cause first"
    for finding in shown:
        late = ", after it was down" if finding.after_impact else ""
        head = f"  {SEVERITY_WORDS[finding.severity]:<8}  "
        yield from wrapped(f"{finding.title}, at {seconds(finding.onset_s)}{late}", head)
        if finding.evidence:
            yield from wrapped(finding.evidence, " " * len(head))
        yield from _led_to(finding, " " * len(head))


def _led_to(finding: Finding | FindingEntry, indent: str) -> Iterator[str]:
    titles = list(dict.fromkeys(f"{one.title} ({seconds(one.onset_s)})" for one in finding.consequences))
    if titles:
        more = f" and {len(titles) - LED_TO_SHOWN} more" if len(titles) > LED_TO_SHOWN else ""
        yield from wrapped(f"led to: {'; '.join(titles[:LED_TO_SHOWN])}{more}", indent)


def hypothesis_lines(hypotheses: Sequence[Hypothesis], findings: Sequence[Finding]) -> Iterator[str]:
    """What explains the failure, the likeliest first."""
    if not hypotheses:
        return
    yield "What explains it"
    for one in hypotheses[:HYPOTHESES_SHOWN]:
        yield from wrapped(hypothesis_text(one, findings), f"  {one.probability:>4.0%}  ")

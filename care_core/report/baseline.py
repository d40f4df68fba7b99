"""Limits proposed from good runs, for other programs (`care.baseline/1`) and for people."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final, Literal

from care_core.diagnose.baseline import Baseline, Proposal, Refused, over
from care_core.diagnose.tolerance import CONFIDENCE, CONTENT
from care_core.diagnose.verdict import fit_text
from care_core.records import field
from care_core.report.document import ProfileEntry
from care_core.report.published import Document, publish
from care_core.run import Fit
from care_core.text import clean, wrapped
from care_core.variables import Op

SCHEMA_ID: Final = "care.baseline/1"
OPTIONS_SHOWN = 6


class RefusedEntry(Document, kw_only=True):
    """A run that says nothing of good runs; `mission` is null where the whole log does not, or holds one."""

    log: str
    mission: int | None
    reason: str


class OverEntry(Document, kw_only=True):
    """A run that counts, and the limits of the profile that it breaks."""

    log: str
    mission: int
    limits: str


class SeenEntry(Document, kw_only=True):
    """What the runs had: how many, and the least, middle and most of them."""

    runs: int
    low: float
    middle: float
    high: float


class QuantileEntry(Document, kw_only=True):
    """Where what 95% of such runs stay within lies, with 90%."""

    low: float
    high: float
    method: str


class ProposalEntry(Document, kw_only=True):
    """A limit: `ratio` times what the reference configuration needs, or a `value` in the unit that belongs to
    `mission`; both null with a `reason` where none is proposed. `seen` and `quantile` are ratios where it is one."""

    objective: str
    unit: str
    op: Op
    ratio: float | None
    value: float | None
    relative: bool
    seen: SeenEntry | None
    quantile: QuantileEntry | None
    mission: dict[str, float]
    reason: str | None


class BaselineDocument(Document, kw_only=True):
    """Limits proposed from good runs, as `care baseline --json` prints them."""

    schema_: Literal["care.baseline/1"] = field(default=SCHEMA_ID, name="schema")
    profile: ProfileEntry
    fit: Fit
    logs: int
    runs: int
    missions: int
    content: float
    confidence: float
    refused: list[RefusedEntry]
    over: list[OverEntry]
    differing_options: list[str]
    limits: list[ProposalEntry]


def baseline_document(found: Baseline) -> BaselineDocument:
    """The proposals as a document."""
    return BaselineDocument(
        profile=publish(ProfileEntry, found.choice),
        fit=publish(Fit, found.choice.fit),
        logs=found.logs,
        runs=len(found.runs),
        missions=found.missions,
        content=CONTENT,
        confidence=CONFIDENCE,
        refused=[_refused(one) for one in found.refused],
        over=[
            OverEntry(log=clean(judged.run.log.path), mission=judged.run.mission.index, limits=clean(broken))
            for judged in found.runs
            if (broken := over(judged))
        ],
        differing_options=list(found.differing),
        limits=[_proposal(one) for one in found.proposals],
    )


def _refused(one: Refused) -> RefusedEntry:
    return RefusedEntry(log=clean(str(one.log)), mission=one.mission, reason=clean(one.reason))


def _proposal(one: Proposal) -> ProposalEntry:
    seen, quantile = None, None
    if one.seen:
        seen = SeenEntry(
            runs=len(one.seen), low=_short(one.seen[0]), middle=_short(one.middle), high=_short(one.seen[-1])
        )
    if one.low is not None and one.high is not None:
        quantile = QuantileEntry(low=_short(one.low), high=_short(one.high), method=one.method)
    return ProposalEntry(
        objective=one.objective.name,
        unit=one.objective.unit,
        op=one.op,
        ratio=one.limit if one.relative else None,
        value=None if one.relative else one.limit,
        relative=one.relative,
        seen=seen,
        quantile=quantile,
        mission=dict(one.mission or {}),
        reason=clean(one.reason) or None,
    )


def _short(value: float) -> float:
    return float(f"{value:.6g}")


def baseline_text(found: Baseline) -> str:
    """The proposals in lines: which runs counted, then each limit with what it rests on."""
    return "\n".join(_lines(found)) + "\n"


def _lines(found: Baseline) -> Iterator[str]:
    yield from wrapped(fit_text(found.choice.title, found.choice.fit))
    flown = f" of {found.missions} mission{'s' if found.missions > 1 else ''}" if found.runs else ""
    runs, logs = len(found.runs), found.logs
    counted = f"{runs} good run{'s' if runs != 1 else ''}{flown} in {logs} log{'s' if logs > 1 else ''}"
    yield from wrapped(counted, "Runs  ")
    for one in found.refused:
        mission = "" if one.mission is None else f", mission {one.mission}"
        yield from wrapped(f"{Path(one.log).name}{mission}: {one.reason}", "  refused  ")
    for judged in found.runs:
        if broken := over(judged):
            name = Path(judged.run.log.path).name
            yield from wrapped(f"{name}, as you call it good, though {broken}", "  counted  ")
    for proposal in found.proposals:
        yield ""
        yield from _of_objective(proposal)
    if not found.runs:
        return
    yield ""
    yield from wrapped(
        f"A limit is what {CONTENT:.0%} of runs like these keep, with {CONFIDENCE:.0%} confidence (one-sided tolerance "
        "limit). Runs of other wind, load or battery than these are not like them."
    )
    if found.differing:
        names = ", ".join(found.differing[:OPTIONS_SHOWN])
        more = len(found.differing) - OPTIONS_SHOWN
        yield from wrapped(
            f"The runs differ in {names}{f' and {more} more' if more > 0 else ''}: the limits allow that."
        )


def _of_objective(one: Proposal) -> Iterator[str]:
    unit = "x" if one.relative else one.objective.unit
    name = one.objective.name
    if one.limit is None:
        yield from wrapped(f"no limit: {one.reason}", f"{name}  ")
    else:
        what = " what the reference configuration needs" if one.relative else ""
        yield from wrapped(f"{one.op} {one.limit:g} {unit}{what}".rstrip(), f"{name}  ")
    if not one.seen:
        return
    count = len(one.seen)
    span = f"{one.seen[0]:.3g} to {one.seen[-1]:.3g}, middle {one.middle:.3g}" if count > 1 else f"{one.seen[0]:.3g}"
    yield from wrapped(f"{count} run{'s' if count > 1 else ''}: {span} {unit}".rstrip(), "  seen     ")
    if one.low is not None:
        side = "below" if one.op in ("<=", "<") else "above"
        yield from wrapped(
            f"{CONTENT:.0%} stay {side} {one.low:.3g} to {one.high:.3g} {unit} ({one.method})", "  90%      "
        )
    bound = one.objective.relative
    if one.relative and one.limit is not None and bound is not None and bound.at_least is not None:
        yield from wrapped(
            f"never stricter than {bound.at_least:g} {one.objective.unit}, as in the profile", "  but      "
        )
    if one.mission:
        yield from wrapped("this mission alone, as its value is a fixed one", "  for      ")

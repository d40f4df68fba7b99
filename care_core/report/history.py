"""`care.history/1`: past triages, trends and kept promises, for other programs and for people."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, Literal

from pydantic import ConfigDict, Field

from care_core.history.store import HistoryError, Triaged, Verified
from care_core.history.track_record import TrackRecord, sparkline, track_record, trends
from care_core.report.document import Strict
from care_core.report.wording import fit_words
from care_core.run import FitVerdict
from care_core.text import clean

SCHEMA_ID: Final = "care.history/1"
_SPARKS = 30
"""Newest values that a trend shows."""


class PastTriage(Strict):
    """`profile` is empty where none fitted, `fit` says how well it did; `verdict` says in words how the run went;
    `options` are those that the suggested fix changes, none without a fix."""

    at: str
    log: str
    mission: int
    fit: FitVerdict
    profile: str
    faults: list[str]
    verdict: str
    cause: str | None
    options: list[str]
    p_fixed: float | None


class PromiseBin(Strict):
    low: float
    high: float
    count: int
    promised: float
    worked: int


class PromiseRecord(Strict):
    """Of `count` fixes that were made and verified, `worked` did; by the promises `expected` should have."""

    count: int
    worked: int
    expected: float
    bins: list[PromiseBin]


class HistoryDocument(Strict):
    """What `care history --json` prints; trends run from the oldest to the newest."""

    model_config = ConfigDict(title=SCHEMA_ID)

    schema_: Literal["care.history/1"] = Field(
        default=SCHEMA_ID, validation_alias="schema", serialization_alias="schema"
    )
    triages: list[PastTriage]
    trends: dict[str, list[float]]
    verified: PromiseRecord


def history_schema() -> dict[str, Any]:
    """The JSON Schema of the history."""
    return HistoryDocument.model_json_schema(by_alias=True, mode="serialization")


def history_document(triages: Sequence[Triaged], verified: Sequence[Verified]) -> HistoryDocument:
    """The document of what is remembered. Raises HistoryError for a record that is no triage."""
    try:
        return HistoryDocument(
            triages=[_past(one) for one in triages],
            trends={name: list(values) for name, values in trends(triages).items()},
            verified=_record(track_record(verified)),
        )
    except (AttributeError, KeyError, TypeError, ValueError) as err:
        raise HistoryError("The history holds a record that is no triage.", hint="Move its file away.") from err


def _past(triaged: Triaged) -> PastTriage:
    document = triaged.document
    causes = [cause["option"] for fault in document["faults"] for cause in fault["causes"]]
    fix: Mapping[str, Any] | None = document["fix"]
    return PastTriage(
        at=triaged.at,
        log=clean(triaged.log_path),
        mission=triaged.mission,
        fit=fit_of(document),
        profile=profile_of(document),
        faults=[fault["objective"] for fault in document["faults"]],
        verdict=verdict_of(document),
        cause=causes[0] if causes else None,
        options=[change["option"] for change in fix["changes"]] if fix else [],
        p_fixed=fix["p_fixed"] if fix else None,
    )


def profile_of(document: Mapping[str, Any]) -> str:
    """The profile of a remembered run, empty where none fitted."""
    return document["profile"]["name"] if document["profile"] else ""


def fit_of(document: Mapping[str, Any]) -> FitVerdict:
    """How well it fitted; the oldest records say nothing of that."""
    verdict: FitVerdict = document.get("fit", {}).get("verdict", "fits")
    return verdict


def verdict_of(document: Mapping[str, Any]) -> str:
    """How a remembered run went, in a clause: the first critical finding, the objectives outside their thresholds, and
    "no fault" only where everything was evaluated and nothing critical was found."""
    critical = [finding["title"] for finding in document.get("findings", ()) if finding["severity"] == "critical"]
    broken = [entry["name"] for entry in document["objectives"] if entry["status"] == "fault"]
    statuses = {entry["status"] for entry in document["objectives"]}
    said = [*critical[:1], *([f"FAULT {', '.join(broken)}"] if broken else [])]
    if said:
        return clean("; ".join(said))
    if "ok" not in statuses:
        return "not evaluated"
    return "not all evaluated" if "not_evaluated" in statuses else "no fault"


def _record(record: TrackRecord) -> PromiseRecord:
    bins = [
        PromiseBin(low=b.low, high=b.high, count=b.count, promised=b.promised, worked=b.worked) for b in record.bins
    ]
    return PromiseRecord(count=record.count, worked=record.worked, expected=record.expected, bins=bins)


def history_json(document: HistoryDocument) -> str:
    """The document, one object."""
    return document.model_dump_json(by_alias=True, indent=2) + "\n"


def history_text(document: HistoryDocument, *, ascii: bool = False) -> str:
    """The history in lines: triages newest first, trends, and how promises held up."""
    return "\n".join(_lines(document, ascii)) + "\n"


def _lines(document: HistoryDocument, ascii: bool) -> Iterator[str]:
    if not document.triages:
        yield "No triage is remembered yet."
    for past in document.triages:
        when = past.at[:16].replace("T", " ")
        fix = "" if past.p_fixed is None else f"  change {', '.join(past.options)} ({past.p_fixed:.0%})"
        fit = fit_words(past.profile, past.fit).removeprefix("Profile ")
        yield clean(f"{when}  {Path(past.log).name}  {fit}  {past.verdict}{fix}")
    if document.trends:
        yield ""
        yield "Trends, oldest to newest"
        width = max(map(len, document.trends))
        for name, values in document.trends.items():
            shown = values[-_SPARKS:]
            span = f"{min(values):.4g} to {max(values):.4g}" if values else "never evaluated"
            yield clean(f"  {name:<{width}}  {sparkline(shown, ascii=ascii)}  {span}")
    yield ""
    yield from _promises(document.verified)


def _promises(record: PromiseRecord) -> Iterator[str]:
    yield verified_line(record.count, record.worked, record.expected)
    for one in record.bins:
        yield (
            f"  promised {one.low:.0%} to {one.high:.0%}: {one.count} made, {one.worked} worked "
            f"({one.worked / one.count:.0%}, promised {one.promised:.0%})"
        )


def verified_line(count: int, worked: int, expected: float) -> str:
    """The track record in one line."""
    if not count:
        return "verified fixes: none yet ('care verify REPORT LOG' after the next run)"
    return f"verified fixes: {count}, worked {worked}, promised {expected:.1f}"

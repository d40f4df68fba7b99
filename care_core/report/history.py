"""`care.history/1`: past triages, trends and kept promises, for other programs and for people."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final, Literal

from care_core.diagnose.verdict import beside, fit_words
from care_core.history.store import HistoryError, Triaged, Verified
from care_core.history.track_record import Bin, sparkline, track_record, trends
from care_core.history.trends import LEAST_RUNS, Direction, RobotRuns, Since, Trend, by_robot
from care_core.records import field
from care_core.report.document import leading_cause, remembered_verdict
from care_core.report.published import Document, publish, publishable
from care_core.report.reading import remembered
from care_core.run import FitVerdict, Robot
from care_core.text import clean, number_of, percent, wrapped

SCHEMA_ID: Final = "care.history/1"
_SPARKS = 24
"""Newest values that a trend shows."""
_ALL = "--all shows them"
_CHANGES = 4
"""Most parameters that are named of those that changed at a run."""


class PastTriage(Document, kw_only=True):
    """`profile` is empty where none fitted, `fit` says how well it did; `verdict` says in words how the run went;
    `options` are those that the suggested fix changes, none without a fix; `judged_with` are the options of the command
    that gave it other limits or another reference than its own, empty without any."""

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
    odds_as_driven: float | None = None
    """Probability that the next run meets all objectives as driven."""
    judged_with: str = ""


class PromiseRecord(Document, kw_only=True):
    """Of `count` fixes that were made and verified, `worked` did; by the promises `expected` should have."""

    count: int
    worked: int
    expected: float
    bins: list[Bin]


class ChangedEntry(Document, kw_only=True):
    """A parameter, or the firmware, that differs from the run before."""

    name: str
    from_: float | str = field(name="from")
    to: float | str


class SinceEntry(Document, kw_only=True):
    """The run from which on an objective is different, and what changed at it."""

    at: str
    log: str
    before: float
    after: float
    p: float
    changed: list[ChangedEntry]


class TrendEntry(Document, kw_only=True):
    """How an objective went, oldest first; `unit` "x": a multiple of what the reference configuration needs. `p` is
    corrected for how many tests were made."""

    objective: str
    unit: str
    values: list[float]
    direction: Direction
    tau: float | None
    p: float | None
    since: SinceEntry | None


class MissionRunsEntry(Document, kw_only=True):
    """Runs that were asked the same, judged by one profile (empty: none fitted)."""

    profile: str
    runs: int
    trends: list[TrendEntry]


class RobotRunsEntry(Document, kw_only=True):
    """`robot` is None for runs of which nothing says whose they are; `faults` is the trend of having a fault."""

    robot: Robot | None
    runs: int
    faulty: int
    faults: TrendEntry
    missions: list[MissionRunsEntry]


class HistoryDocument(Document, kw_only=True):
    """What `care history --json` prints; trends run from the oldest to the newest."""

    schema_: Literal["care.history/1"] = field(default=SCHEMA_ID, name="schema")
    triages: list[PastTriage]
    trends: dict[str, list[float]]
    robots: list[RobotRunsEntry] = field(default_factory=list)
    verified: PromiseRecord


def history_document(
    triages: Sequence[Triaged], verified: Sequence[Verified], limit: int | None = None
) -> HistoryDocument:
    """The document of what is remembered: of `limit` triages, and of all robots. Raises HistoryError for a record that
    is no triage."""
    try:
        return HistoryDocument(
            triages=[_past(one) for one in triages[:limit]],
            trends={name: list(values) for name, values in trends(triages[:limit]).items()},
            robots=[_robot(one) for one in robots_of(triages)],
            verified=publish(PromiseRecord, track_record(verified)),
        )
    except (AttributeError, KeyError, TypeError, ValueError) as err:
        raise HistoryError("The history holds a record that is no triage.", hint="Move its file away.") from err


def _past(triaged: Triaged) -> PastTriage:
    document = remembered(triaged.document)
    fix = document.fix
    return PastTriage(
        at=triaged.at,
        log=clean(triaged.log_path),
        mission=triaged.mission,
        fit=document.fit.verdict,
        profile=document.profile.name if document.profile else "",
        faults=[fault.objective for fault in document.faults],
        verdict=remembered_verdict(document).headline,
        cause=leading_cause(document) or None,
        options=[change.option for change in fix.changes] if fix else [],
        p_fixed=fix.odds if fix else None,
        odds_as_driven=document.odds_as_driven,
        judged_with=clean(triaged.judged_with),
    )


def robots_of(triages: Sequence[Triaged]) -> tuple[RobotRuns, ...]:
    """The past by robot and mission, with its trends."""
    verdicts = (remembered_verdict(remembered(one.document)) for one in triages)
    return by_robot(triages, {place: verdict.status == "fault" for place, verdict in enumerate(verdicts)})


def _robot(one: RobotRuns) -> RobotRunsEntry:
    return RobotRunsEntry(
        robot=None if one.robot is None else publish(Robot, one.robot),
        runs=len(one.runs),
        faulty=one.faulty,
        faults=_trend(one.faults),
        missions=[
            MissionRunsEntry(profile=m.profile, runs=len(m.runs), trends=[_trend(trend) for trend in m.trends])
            for m in one.missions
        ],
    )


def _trend(trend: Trend) -> TrendEntry:
    since = trend.since
    return publish(TrendEntry, trend, since=since and _since(since))


def _since(since: Since) -> SinceEntry:
    run = since.run
    changed = [
        ChangedEntry(name=clean(one.name), from_=publishable(one.before), to=publishable(one.after))
        for one in since.changed
    ]
    at = run.document["log"].get("start") or run.at
    return publish(SinceEntry, since, at=at, log=clean(run.log_path), changed=changed)


def history_text(document: HistoryDocument, *, ascii: bool = False, everything: bool = False) -> str:
    """The history in lines of 80 columns: triages newest first, trends, and how promises held up.

    Args:
        everything: robots and missions with too few runs to show a trend, too, which else are one line.
    """
    return "\n".join(_lines(document, ascii, everything)) + "\n"


def _lines(document: HistoryDocument, ascii: bool, everything: bool) -> Iterator[str]:
    if not document.triages:
        yield "No triage is remembered yet."
    for past in document.triages:
        when = past.at[:16].replace("T", " ")
        odds = "odds not measured" if past.p_fixed is None else f"{percent(past.p_fixed)}{beside(past.odds_as_driven)}"
        fix = f"  change {', '.join(past.options)} ({odds})" if past.options else ""
        fit = fit_words(past.profile, past.fit).removeprefix("Profile ")
        own = f"  (judged with {past.judged_with})" if past.judged_with else ""
        line = f"{when}  {Path(past.log).name}  {fit}  {past.verdict}{own}{fix}"
        yield from wrapped(line, rest=" " * (len(when) + 2))
    told = [robot for robot in document.robots if everything or not _is_thin(_all_trends(robot))]
    for robot in told:
        yield ""
        yield from _robot_lines(robot, ascii, everything)
    thin = [f"{_name(robot)} ({number_of(robot.runs, 'run')})" for robot in document.robots if robot not in told]
    if thin:
        yield ""
        yield from wrapped(f"Fewer than the {LEAST_RUNS} runs of a trend ({_ALL}): {', '.join(thin)}", rest="  ")
    if any(trend.since for robot in document.robots for trend in _all_trends(robot)):
        yield ""
        yield from wrapped("What changed at the same run need not be the cause: 'care triage LOG' asks for that.")
    yield ""
    yield from _promises(document.verified)


def _all_trends(robot: RobotRunsEntry) -> list[TrendEntry]:
    return [robot.faults, *(trend for mission in robot.missions for trend in mission.trends)]


def _is_thin(trends: Sequence[TrendEntry]) -> bool:
    """Whether there are too few runs to say anything."""
    return all(trend.direction == "too few" for trend in trends)


def _name(robot: RobotRunsEntry) -> str:
    return "robot not known" if robot.robot is None else robot.robot.name


def _robot_lines(robot: RobotRunsEntry, ascii: bool, everything: bool) -> Iterator[str]:
    name = "Robot not known" if robot.robot is None else f"Robot {robot.robot.name}"
    source = "--robot NAME tells whose a log is" if robot.robot is None else robot.robot.source
    is_shared = robot.robot is not None and (not robot.robot.is_sure or robot.robot.is_simulated)
    doubt = ", others may share it" if is_shared else ""
    faulty = "none" if not robot.faulty else f"{robot.faulty} of them"
    head = f"{name} ({source}{doubt}): {number_of(robot.runs, 'run')}, {faulty} with a fault"
    if robot.robot is None:
        yield from wrapped(f"{head}; no trends, for they may be of several robots")
        return
    yield from wrapped(head)
    missions = [(n, one) for n, one in enumerate(robot.missions, 1) if everything or not _is_thin(one.trends)]
    width = max(len(trend.objective) for trend in (robot.faults, *(t for _, one in missions for t in one.trends)))
    yield from _trend_lines(robot.faults, "  ", width + 2, ascii)
    for number, mission in missions:
        judged = f"by {mission.profile}" if mission.profile else "without a profile"
        yield clean(f"  mission {number}: {number_of(mission.runs, 'run')} judged {judged}")
        for trend in mission.trends:
            yield from _trend_lines(trend, "    ", width, ascii)
    if thin := len(robot.missions) - len(missions):
        yield f"  {number_of(thin, 'mission')} with fewer than the {LEAST_RUNS} runs of a trend ({_ALL})"


def _trend_lines(trend: TrendEntry, indent: str, width: int, ascii: bool) -> Iterator[str]:
    values = trend.values
    span = "" if not values else f", {_between(min(values), max(values), trend.unit)}"
    said = {
        "too few": f"{number_of(len(values), 'value')}{span}: needs {LEAST_RUNS} runs to show a trend",
        "constant": f"always {_figure(values[0], trend.unit)}" if values else "",
        "none": f"no trend{span}",
        "worse": f"GETS WORSE{span}",
        "better": f"gets better{span}",
    }[trend.direction]
    chance = "" if trend.p is None else f" (p {_p(trend.p)})"
    line = f"{indent}{trend.objective:<{width}}  {sparkline(values[-_SPARKS:], ascii=ascii)}  {said}{chance}"
    yield from wrapped(line, rest=" " * (len(indent) + width + 2))
    if trend.since is not None:
        since = trend.since
        when = since.at[:16].replace("T", " ")
        moved = f"from {_figure(since.before, '')} to {_figure(since.after, trend.unit)}"
        moved += f" since {when}, {Path(since.log).name} (p {_p(since.p)})"
        shown = [f"{one.name} {_value(one.from_)} -> {_value(one.to)}" for one in since.changed[:_CHANGES]]
        more = len(since.changed) - len(shown)
        others = f" and {more} more" if more else ""
        what = f"changed at that run: {', '.join(shown)}{others}" if shown else "no parameter changed at that run"
        yield from wrapped(f"{moved}; {what}", first=indent + "  ")


def _between(low: float, high: float, unit: str) -> str:
    return _figure(high, unit) if low == high else f"between {low:.4g} and {_figure(high, unit)}"


def _figure(value: float, unit: str) -> str:
    return f"{value:.4g} {unit}".rstrip() if unit != "x" else f"{value:.4g} x what it needs"


def _value(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.7g}"


def _p(p: float) -> str:
    return "below 0.001" if p < 0.001 else f"{p:.2g}"


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

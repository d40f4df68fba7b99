"""One log in one row: plain values, small enough to send between machines and to keep by the thousand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from care_core.causal.counterfactual import Config, CounterfactualQuery, known_value
from care_core.causal.model import Model
from care_core.diagnose.noisy_or import NoisyOr, What
from care_core.diagnose.promise import Promise
from care_core.diagnose.ranking import deviating
from care_core.diagnose.records import Confidence, Diagnosis
from care_core.diagnose.verdict import RunStatus, verdict_of
from care_core.ecosystems.findings import FindingKind, Severity
from care_core.numbers import Floats
from care_core.records import Record, field, replace
from care_core.run import FitVerdict, is_known
from care_core.text import clean
from care_core.variables import Op, Threshold

MAIN = 0.5
"""An explanation this likely is likelier than all others together: it is counted as the run's cause."""
_SORTS = ("vehicle", "stack", "ros")
"""The facts of a log that tell what sort of robot it is of, the best first."""
TOLD = 0.05
"""Explanations less likely than this are not kept."""


class Explained(Record):
    """An explanation of a failure. `kind` is that of the finding which speaks for it, None for a parameter."""

    what: What
    name: str
    probability: float
    kind: FindingKind | None = None


class NamedCause(Record):
    """An option that cost the run something, with what the run had and what would be better."""

    option: str
    confidence: Confidence
    current: float
    suggested: float | None


class Seen(Record):
    """A finding that no other one explains."""

    kind: FindingKind
    title: str
    severity: Severity


class Asked(Record):
    """What a profile's model needs to be asked about a run: how it was set, what it met, how it ended, its limits."""

    config: Mapping[str, float]
    observed: Mapping[str, float]
    thresholds: Mapping[str, tuple[Op, float]]
    failure: NoisyOr | None = None
    """The causes that may have lost it; None where nothing was lost."""

    def odds(self, model: Model, broken: Sequence[str], configs: Sequence[Config]) -> Floats:
        """Probability that the next run meets every limit under each configuration, shape (m,), as a report says it."""
        if self.failure is None:
            return self.query(model).probability(configs)
        return Promise(self.failure, self.query(model), broken).odds(configs)

    def query(self, model: Model) -> CounterfactualQuery:
        """The run, ready to be asked what other values would have done."""
        bounds = {name: Threshold(op, value) for name, (op, value) in self.thresholds.items()}
        return CounterfactualQuery(model, self.config, self.observed, bounds)


class Row(Record):
    """What became of one run. A log that cannot be read is a row too: `status` "unreadable", and `reason` says why."""

    log: str
    status: RunStatus
    reason: str = ""
    robot: str | None = None
    """What tells it from all others; None where the log does not."""
    called: str = ""
    """What people call the robot."""
    folder: str = ""
    """The name of the folder that holds the log."""
    start: str | None = None
    """ISO 8601 in UTC, None where the log has no wall clock."""
    duration_s: float = 0.0
    sha256: str = ""
    recording: str = ""
    """What copies of it share."""
    mission: int = 0
    kind: str = ""
    """What sort of robot it is: only robots of one sort are compared."""
    firmware: str = ""
    frame: str = ""
    profile: str = ""
    """Empty where none fits."""
    version: str = ""
    fit: FitVerdict = "no"
    objectives: Mapping[str, float] = field(default_factory=dict)
    breaches: tuple[str, ...] = ()
    explained: tuple[Explained, ...] = ()
    """What explains a failure, the likeliest first."""
    causes: tuple[NamedCause, ...] = ()
    findings: tuple[Seen, ...] = ()
    change: Mapping[str, float] = field(default_factory=dict)
    """The change that the run's own diagnosis advises."""
    p_fixed: float | None = None
    off: Mapping[str, float] = field(default_factory=dict)
    """Options that are off their reference, with the reference."""
    asked: Asked | None = None
    """None where no model can be asked."""

    @property
    def is_judged(self) -> bool:
        """Whether anything is known of how the run went."""
        return self.status in ("ok", "fault")

    @property
    def main(self) -> Explained | None:
        """What explains the failure better than everything else together, None where nothing does."""
        first = self.explained[0] if self.explained else None
        if first is None or not first.name or first.what == "chance" or first.probability < MAIN:
            return None
        return first


def row_of(log: str, diagnosis: Diagnosis, query: CounterfactualQuery | None = None) -> Row:
    """The row of a diagnosed run.

    Args:
        log: how the log is called.
        world: the run as its profile's model was asked about it; None where no model was.
    """
    run, profile = diagnosis.run, diagnosis.profile
    facts, robot = run.log.facts, run.log.robot
    kinds = {finding.title: finding.kind for finding in diagnosis.health.findings}
    causes = {cause.option.name: cause for fault in diagnosis.faults for cause in fault.causes if not cause.is_lead}
    unknown = next((one.reason for one in diagnosis.objectives if one.status == "not_evaluated"), "")
    return Row(
        log=clean(log),
        status=verdict_of(diagnosis).status,
        reason=clean(unknown or diagnosis.health.too_little or "; ".join(profile.fit.reasons[:1])),
        robot=robot.id if robot is not None and robot.is_sure else None,
        called=robot.name if robot is not None and robot.is_sure else "",
        start=run.log.start,
        duration_s=run.log.duration_s,
        sha256=run.log.sha256,
        # What its robot put its own number into is no copy of another robot's.
        recording=f"{run.log.identity} {robot.id}" if robot is not None and robot.is_sure else run.log.identity,
        mission=run.mission.index,
        kind=clean(next((facts[name] for name in _SORTS if facts.get(name)), run.log.format)),
        firmware=clean(facts.get("firmware") or facts.get("distro") or ""),
        frame=clean(facts.get("frame", "")),
        profile=profile.name,
        version=profile.version,
        fit=profile.fit.verdict,
        objectives={one.name: float(one.value) for one in diagnosis.objectives if is_known(one.value)},
        breaches=tuple(one.name for one in diagnosis.objectives if one.status == "fault"),
        explained=tuple(
            Explained(one.what, clean(one.name), one.probability, kinds.get(one.name))
            for one in diagnosis.hypotheses
            if one.probability >= TOLD
        ),
        causes=tuple(
            NamedCause(name, cause.confidence, cause.current, cause.suggested) for name, cause in causes.items()
        ),
        findings=tuple(
            Seen(one.kind, clean(one.title), one.severity)
            for one in diagnosis.health.findings
            if one.severity != "info" and not one.after_impact
        ),
        change={} if diagnosis.fix is None else {one.option.name: one.suggested for one in diagnosis.fix.changes},
        p_fixed=None if diagnosis.fix is None else diagnosis.fix.odds,
        off={} if query is None else {name: query.reference[name] for name in deviating(query.config, query.reference)},
        asked=None if query is None else _query_of(query, diagnosis.failure),
    )


def unreadable(log: str, reason: str) -> Row:
    """The row of a log that gave no run, and why."""
    return Row(clean(log), "unreadable", clean(reason))


def distinct(rows: Sequence[Row]) -> tuple[Row, ...]:
    """The rows without copies: the same recording under two names is one run."""
    return tuple({_of_run(row): row for row in reversed(rows)}.values())[::-1]


def copies_of(rows: Sequence[Row]) -> dict[int, str]:
    """By the place of a row that is the same recording as an earlier one: that one's log."""
    first = {_of_run(row): row for row in distinct(rows)}
    return {place: first[_of_run(row)].log for place, row in enumerate(rows) if first[_of_run(row)] is not row}


def _of_run(row: Row) -> tuple[str, int]:
    recording = row.recording or row.sha256
    return (recording, row.mission) if recording else (row.log, 0)


def by_folder(row: Row) -> Row:
    """The row with the folder of its log for a robot, where the log names none."""
    return row if row.robot or not row.folder else replace(row, robot=row.folder, called=row.folder)


def _query_of(query: CounterfactualQuery, failure: NoisyOr | None) -> Asked:
    """Only what the model reads of the run."""
    stages = {stage.variable for outcome in query.model.outcomes.values() for stage in outcome.stages}
    known = {name: known_value(query.observed, name) for name in (*query.model.outcomes, *sorted(stages))}
    return Asked(
        dict(query.config),
        {name: value for name, value in known.items() if value is not None},
        {name: (bound.op, bound.bound) for name, bound in query.thresholds.items()},
        failure,
    )

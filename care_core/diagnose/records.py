"""What a diagnosis is made of. Plain values: reports and the terminal app read these and nothing else."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import Literal

from care_core.diagnose.noisy_or import UNKNOWN, NoisyOr, What
from care_core.ecosystems.findings import NOTHING_SEEN, Health
from care_core.ecosystems.ranking import lost_by
from care_core.metadata.causal_map import Role as ParameterRole
from care_core.records import Record, field
from care_core.run import MissionInfo, ProfileChoice, Run, shown
from care_core.text import figures
from care_core.variables import Change, Kind, Threshold, Variable

Status = Literal["ok", "fault", "not_evaluated"]
Confidence = Literal["high", "medium", "low"]


class Need(Record):
    """What the reference configuration would need for this very mission, vehicle and conditions, with its 80%
    interval."""

    value: float
    low: float
    high: float
    is_own: bool = False
    """Whether this run was driven as the reference."""

    @property
    def exceeded(self) -> str:
        """How often the reference takes more than a limit that its spread sets."""
        return "one run in fifty" if self.is_own else "one run in ten"


class ObjectiveResult(Record):
    """An objective of this run against its threshold. `reason`: why it was not evaluated, or how it failed."""

    variable: Variable
    value: float | None
    threshold: Threshold | None
    status: Status
    reason: str = ""
    percentile: float | None = None
    """Share (0 to 1) of the profile's training runs with a smaller value."""
    need: Need | None = None
    """What the threshold is a multiple of, where it is no fixed one."""

    @property
    def name(self) -> str:
        return self.variable.name

    @property
    def sentence(self) -> str:
        """What it came to, where it was missed."""
        wanted = str(self.threshold or "")
        return outcome(self.name, self.variable.kind, self.value, self.variable.unit, wanted, self.reason)

    @property
    def is_sure(self) -> bool:
        """Whether the verdict holds wherever in its interval the need lies."""
        if self.need is None or self.value is None or self.variable.relative is None:
            return True
        bounds = (self.variable.relative.for_need(need) for need in (self.need.low, self.need.high))
        return len({bound.met(self.value) for bound in bounds}) == 1

    @property
    def wanted(self) -> str:
        """The threshold as an operator reads it, and where it comes from."""
        if self.threshold is None:
            return "no threshold"
        bound = f"{self.threshold} {self.variable.unit}".rstrip()
        return f"{bound} ({self.basis})" if self.basis else bound

    @property
    def basis(self) -> str:
        """What the threshold was made of and where it is written, empty where it is the profile's fixed one."""
        declared = self.variable.threshold
        written = f"limit of {declared.source}" if declared and declared.source and self.threshold is not None else ""
        parts = (self._made_of, written)
        return "; ".join(part for part in parts if part)

    @property
    def _made_of(self) -> str:
        if self.need is None or self.threshold is None or self.variable.relative is None:
            return ""
        need = f"{figures(self.need.value)} {self.variable.unit}".rstrip()
        least = self.variable.relative.at_least
        if self.threshold.value == least:
            allowed = f"{least:g} {self.variable.unit}".rstrip()
            return f"{allowed} is always allowed; the reference configuration needs {need} for this mission"
        if self.threshold != self.variable.relative.for_need(self.need.value):
            return f"the reference configuration needs {need} for this mission; {self.need.exceeded} exceeds this limit"
        if self.variable.relative.ratio == 1:
            return f"the reference configuration needs {need} for this mission"
        return f"{self.variable.relative.ratio:g} x the {need} that the reference configuration needs for this mission"


_MISSED = {
    "mission_time": "too slow: {}",
    "energy": "too much energy: {}",
    "path_error_max": "off its path by up to {}",
    "height_error": "off its height by {} on average",
    "airspeed_error": "off its airspeed by {} on average",
    "depth_error": "off its depth by {} rms",
}
"""What it is to be above the limit of an objective that many profiles have."""
MISSION_FAILED = "the mission failed"
"""All that is known of a mission that failed where nothing says how."""


def outcome(name: str, kind: Kind | None, value: float | None, unit: str, threshold: str, reason: str) -> str:
    """An objective that was missed, in a clause: how it failed, or what it came to and what was wanted."""
    if kind == "functional":
        return reason or (MISSION_FAILED if name.casefold() == "mission_success" else f"{name} not met")
    measured = "unknown" if value is None else f"{value:.4g} {unit}".rstrip()
    if name in _MISSED and threshold.startswith("<"):
        return f"{_MISSED[name].format(measured)}, limit {threshold.lstrip('<= ')} {unit}".rstrip()
    wanted = f", wanted {threshold} {unit}".rstrip() if threshold else ""
    return f"{name} {measured}{wanted}"


class MissionVerdict(Record):
    """One mission of a log with what became of it."""

    mission: MissionInfo
    status: Status
    reason: str
    """What was broken, or why it could not be judged; empty where all is well."""
    results: tuple[ObjectiveResult, ...] = ()


class Prediction(Record):
    """A predicted value of an objective with its 80% interval, and the probability that it keeps its threshold."""

    value: float
    low: float
    high: float
    p_ok: float | None = None

    def status(self) -> Status:
        if self.p_ok is None:
            return "not_evaluated"
        return "ok" if self.p_ok >= 0.5 else "fault"


class PathNode(Record):
    """One node of a causal path as this run met it: its value, and what the reference configuration would give."""

    name: str
    unit: str
    value: float | None
    expected: float | None
    effect: float | None = None
    """Standardised effect of the edge that leads to the next node, signed; None on the last node."""
    support: float | None = None
    """Share of bootstrap resamples that hold the edge to the next node; None on the last node, and of what physics
    says."""


NoteKind = Literal["outside_training", "in_the_log", "other"]


class Note(Record):
    """A sentence about a cause: what weakens it, what the log itself says of it, what a change of it needs."""

    text: str
    kind: NoteKind = "other"


class Cause(Record):
    """An option with the path by which it moved a faulty objective in this run.

    `path_ace` is the paper's Eq. 2 on scaled variables (it ranks the platform, not this run); `total_effect` the
    option's Eq. 1 effect on the objective. `contribution` is how much of this run's probability of being fault-free the
    option costs (0 to 1): counterfactual change against the profile's reference configuration.
    """

    rank: int
    option: Variable
    path: tuple[PathNode, ...]
    path_ace: float
    total_effect: float
    contribution: float
    current: float
    suggested: float | None
    predicted: Prediction | None
    p_fixed: float | None
    confidence: Confidence
    in_support: bool
    notes: tuple[Note, ...] = ()
    is_assumed: bool = False
    """Whether no source holds the current value: it is taken to be at its reference."""
    is_lead: bool = False
    """Not shown to cost this run anything, only not ruled out: what to look at next when no cause convinces."""


class Fault(Record):
    """A faulty objective with its causes, best first."""

    objective: ObjectiveResult
    causes: tuple[Cause, ...]


def helps(odds: float | None, as_driven: float | None) -> bool:
    """Whether a change is predicted to bring more than none, as far as both were measured."""
    return odds is None or as_driven is None or odds > as_driven


class Odds(Record):
    """How likely every objective is met with an option at a value."""

    value: float
    p_ok: float
    is_guess: bool
    """Whether no training run came near the changes."""


class Fix(Record):
    """A set of changes with its predicted outcome. `p_fixed`: probability that all objectives keep their thresholds."""

    changes: tuple[Change, ...]
    p_fixed: float
    predicted: Mapping[str, Prediction]
    shown_by: str = ""
    """The finding of this run that shows its cause, where training says little of it: `p_fixed` is no promise then."""
    by_hand: bool = False
    """Whether the operator chose it, and no suggestion is."""

    @property
    def odds(self) -> float | None:
        """What it promises, None where that was not measured."""
        return None if self.shown_by else self.p_fixed

    @property
    def why_not_measured(self) -> str:
        """Why it promises nothing; empty where it does."""
        return f"this run shows it ({self.shown_by}), training says too little of it" if self.shown_by else ""

    @property
    def is_guess(self) -> bool:
        """Whether it takes a value that no training run came near: beside every probability that is said."""
        return not all(change.in_support for change in self.changes)


class Circumstance(Record):
    """What this run met and no option set: a rival to the causes named."""

    name: str
    """`wind`, `battery`, ... as the profile calls it."""
    variable: str
    """The context or metric that shows it; empty where a message says so."""
    value: float | None
    unit: str
    low: float | None
    high: float | None
    """Where 95% of the training runs lie."""
    share: float
    """Share of the training runs that lie farther out (a metric: than its configuration explains)."""
    text: str


class Experiment(Record):
    """What would tell two causes apart: one option changed alone, and the probability of success under each."""

    objective: str
    option: Variable
    value: float
    if_cause: tuple[tuple[str, float], ...]
    """(the cause, probability that the objective then keeps its threshold), the leading cause first."""

    def __str__(self) -> str:
        change = f"change only {self.option.name} to {self.option.show(self.value)} and run again"
        expected = ", ".join(f"{p:.0%} if the cause is {name}" for name, p in self.if_cause)
        return f"{change}: probability of a good {self.objective} is {expected}"


class Hypothesis(Record):
    """One explanation of the failure. Those of a diagnosis add up to 1: each has the probability that it acted and none
    that is told before it did."""

    what: What
    name: str
    """The option, or the finding's title; empty for chance, and for a parameter that the profile does not know."""
    probability: float
    acts: float = 0.0
    """Probability that it acted, whatever else did: causes are not exclusive."""


UNLIKELY = 0.05
"""A parameter that acted with less than this is named, and no more: its paths would hide those that may matter."""


def told_in_full(option: str, hypotheses: Collection[Hypothesis], changed: Collection[str]) -> bool:
    """Whether more is told of a cause than its name: it may well have acted, or is to be changed, or nothing weighs the
    causes."""
    acts = {one.name: one.acts for one in hypotheses if one.what == "parameter"}
    return not hypotheses or option in changed or acts.get(option, 0.0) >= UNLIKELY


def first_named(hypotheses: Iterable[Hypothesis]) -> Hypothesis | None:
    """The likeliest explanation that has a name: a parameter that nothing knows can be looked for nowhere."""
    return next((one for one in hypotheses if (one.what, one.name) != UNKNOWN), None)


class OutsideSuspect(Record):
    """A parameter that the profile does not model, and that may have lost this run."""

    name: str
    value: float
    back: float
    """What to put it back to: the last good run's value, else the firmware's default."""
    weight: float
    """Probability that it is wrong and loses a mission in this way, before other explanations are weighed (0 to 1)."""
    role: ParameterRole
    is_learned: bool
    """Whether flights with such a value were lost in this way."""
    text: str
    """Value, default, and what speaks against it."""
    is_last_good: bool = False
    """Whether it goes back to the last good run's value, not to the firmware's default."""

    @property
    def back_in_words(self) -> str:
        """What to put it back to, and whose value that is."""
        return f"{shown(self.back)} in the good run" if self.is_last_good else f"default {shown(self.back)}"


class ParameterChange(Record):
    """A parameter with another value than in the good run; None where that log does not hold it."""

    parameter: str
    option: Variable | None
    """The profile's option that it sets, None for any other parameter."""
    before: float | str | None
    after: float | str | None

    @property
    def text(self) -> str:
        return f"{shown(self.before)} -> {shown(self.after)}"


class Since(Record):
    """What changed since the last good run, options of the profile first. `warnings` say what is odd about that log."""

    log: str
    changes: tuple[ParameterChange, ...]
    warnings: tuple[str, ...] = ()
    is_reference: bool = False
    """Whether the run was judged against the configuration of that log."""


class Dismissal(Record):
    """A cause that the operator has set aside, and why."""

    option: str
    reason: str


class Diagnosis(Record):
    """The whole answer for one run. `fix` is None when nothing is broken or the engine abstains (`abstained`)."""

    profile: ProfileChoice
    run: Run
    objectives: tuple[ObjectiveResult, ...]
    faults: tuple[Fault, ...]
    fix: Fix | None
    alternatives: tuple[Fix, ...] = ()
    odds_as_driven: float | None = None
    """Probability that the next run meets all objectives as driven, given that this one failed; None where nothing
    failed, or no model can be asked."""
    abstained: str | None = None
    why_this: str = ""
    """Why another parameter is changed than the likeliest cause, or why the change adds little; empty where neither."""
    notes: tuple[str, ...] = field(default=())
    since: Since | None = None
    """The comparison with a good log, where one was named."""
    rivals: tuple[Circumstance, ...] = ()
    """What the run met that may explain the fault instead; only where no cause is sure."""
    tell_more: tuple[str, ...] = ()
    """How to find out more: a metric to record, an experiment; only where no cause is sure."""
    dismissed: tuple[Dismissal, ...] = ()
    missions: tuple[MissionVerdict, ...] = ()
    """Every mission of the log, this one among them."""
    health: Health = NOTHING_SEEN
    hypotheses: tuple[Hypothesis, ...] = ()
    """What explains the failure, the likeliest first; empty where nothing failed."""
    failure: NoisyOr | None = None
    """The causes behind the hypotheses; None where no model can be asked."""
    outside: tuple[OutsideSuspect, ...] = ()
    """The suspects among the parameters that the profile does not model, the likeliest first."""

    @property
    def lost_by(self) -> tuple[str, ...]:
        """What lost the run and no prediction knows of."""
        return lost_by(self.health.findings, is_judged=bool(self.faults))

"""One change for a fleet: right for most of the robots that fail and harmful to none that does not, or none.

Every run is asked the same question by its own profile's model: how likely would it have met all its limits with this
option at this value, under what it met. A robot is helped where the change adds enough to the odds of most of its
failed runs, as for a single run, and a part that failed is repaired by no value.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from statistics import fmean
from typing import Literal

from numpy import float64
from numpy.typing import NDArray

from care_core.causal.model import Model
from care_core.configs.driven import same_value
from care_core.diagnose.fixes import GAIN_FOR_ONE_MORE
from care_core.diagnose.worth import adds_enough
from care_core.errors import CareError
from care_core.fleet.rows import Row, distinct
from care_core.fleet.shared import FEWEST, Unit, name_of, unit_of
from care_core.profile.store import Profile, installed_profile
from care_core.records import Record, replace
from care_core.variables import Variable

Effect = Literal["helped", "not helped", "harmed", "unharmed", "has it", "unknown"]
Probabilities = NDArray[float64]

MOST_TRIED = 16
"""Values that are tried, the most often named ones: what only one run of hundreds names helps no majority."""


class Outlook(Record):
    """One robot under the change. Probabilities are those of its runs that failed, else of all, on average."""

    name: str
    effect: Effect
    now: float | None
    then: float | None
    is_failing: bool = False
    why: str = ""


class Suggestion(Record):
    """One option at one value on every robot of a profile, with what it would do to each."""

    profile: str
    option: Variable
    value: float
    unit: Unit
    outlooks: tuple[Outlook, ...]

    def having(self, *effects: Effect) -> tuple[Outlook, ...]:
        return tuple(one for one in self.outlooks if one.effect in effects)

    @property
    def failing(self) -> int:
        """How many robots fail now."""
        return sum(outlook.is_failing for outlook in self.outlooks)


class Silence(Record):
    """Why no change is suggested to the robots of a profile, and the best one that was found."""

    profile: str
    reason: str
    best: Suggestion | None = None


def suggest(
    rows: Sequence[Row], load: Callable[[str], Profile] = installed_profile
) -> tuple[Suggestion | Silence, ...]:
    """For each profile that judged robots which fail: the change that helps most of them, or why there is none."""
    judged = [row for row in distinct(rows) if row.profile and row.is_judged]
    return tuple(
        _of_profile(name, [row for row in judged if row.profile == name], load)
        for name in dict.fromkeys(row.profile for row in judged if row.status == "fault")
    )


def _of_profile(name: str, rows: Sequence[Row], load: Callable[[str], Profile]) -> Suggestion | Silence:
    unit = unit_of(rows)
    failing = {name_of(row, unit) for row in rows if row.status == "fault"}
    if len(failing) < FEWEST:
        return Silence(name, f"only one {unit} fails: 'care triage' says what to change on it")
    try:
        profile = load(name)
        model = profile.model
    except CareError as err:
        return Silence(name, err.message.rstrip("."))
    if profile.schema.learned_elsewhere:
        return Silence(name, profile.schema.learned_elsewhere)
    # Workers of a cluster may have another version of the profile: their runs were asked by another model.
    asked = [row if row.version == profile.schema.version else _unasked(row) for row in rows]
    if not (candidates := _candidates(profile, model, rows)):
        return Silence(name, "no run names a parameter that could be changed")
    best = max(_tried(name, model, candidates, asked, unit), key=_worth)
    return best if _is_good(best) else Silence(name, _why_not(best), best)


def _unasked(row: Row) -> Row:
    return replace(row, asked=None)


def _candidates(profile: Profile, model: Model, rows: Sequence[Row]) -> tuple[tuple[Variable, float], ...]:
    """Values that the runs' own diagnoses name, and the references of the options that they blame, the most named
    first. Of a safety option only the reference: nothing looser is ever suggested."""
    named: Counter[tuple[str, float]] = Counter()
    for row in rows:
        for cause in row.causes:
            if cause.option in row.off:
                named[cause.option, row.off[cause.option]] += 1
            if cause.suggested is not None:
                named[cause.option, cause.suggested] += 1
        named.update(row.change.items())
    references = {(name, value) for row in rows for name, value in row.off.items()}
    found = []
    for (name, value), _ in named.most_common():
        option = profile.schema.variables.get(name)
        if option is None:  # of another version of the profile, on a worker
            continue
        is_safe = not option.safety or (name, value) in references
        if is_safe and option.accepts(value) and model.supports(name, value):
            found.append((option, value))
    return tuple(found[:MOST_TRIED])


def _tried(
    name: str, model: Model, candidates: Sequence[tuple[Variable, float]], rows: Sequence[Row], unit: Unit
) -> list[Suggestion]:
    """Every candidate with what it would do to each robot. A run is asked all of them at once."""
    robots: dict[str, list[tuple[Row, Probabilities | None]]] = {}
    for row in rows:
        robots.setdefault(name_of(row, unit), []).append((row, _answer(row, model, candidates)))
    return [
        Suggestion(
            name,
            option,
            value,
            unit,
            tuple(
                _outlook(robot, [_Run(row, option.name, value, answer, place) for row, answer in own])
                for robot, own in robots.items()
            ),
        )
        for place, (option, value) in enumerate(candidates)
    ]


def _answer(row: Row, model: Model, candidates: Sequence[tuple[Variable, float]]) -> Probabilities | None:
    """The probabilities that a run meets every limit, unchanged and then with each candidate; None where no model can
    be asked."""
    # A worker may have had a profile of the same name and version that was trained on other variables.
    if row.asked is None or any(
        name not in row.asked.config for one in model.mechanisms.values() for name in one.inputs
    ):
        return None
    config = row.asked.config
    changed = [{**config, option.name: value} for option, value in candidates]
    return row.asked.odds(model, row.breaches, [config, *changed])


class _Run(Record, eq=False):
    """One run under one candidate."""

    row: Row
    option: str
    value: float
    answer: Probabilities | None
    place: int

    @property
    def has_it(self) -> bool:
        asked = self.row.asked
        return asked is not None and self.option in asked.config and same_value(asked.config[self.option], self.value)

    @property
    def now(self) -> float | None:
        return None if self.answer is None else float(self.answer[0])

    @property
    def then(self) -> float | None:
        return None if self.answer is None else float(self.answer[1 + self.place])

    @property
    def gain(self) -> float:
        return 0.0 if self.now is None or self.then is None or self.has_it else self.then - self.now

    @property
    def is_helped(self) -> bool:
        is_asked = self.now is not None and self.then is not None and not self.has_it
        return is_asked and adds_enough(self.then or 0.0, self.now or 0.0, 1)


def _outlook(robot: str, runs: Sequence[_Run]) -> Outlook:
    failed = [run for run in runs if run.row.status == "fault"]
    asked = [run for run in failed or runs if run.answer is not None]
    now, then = (_mean([getattr(run, name) for run in asked]) for name in ("now", "then"))
    if any(run.row.status == "ok" and run.gain <= -GAIN_FOR_ONE_MORE for run in runs):
        return Outlook(robot, "harmed", now, then, bool(failed))
    if not asked:
        return Outlook(robot, "unknown", None, None, bool(failed), "no model can be asked about its runs")
    if all(run.has_it for run in asked):
        return Outlook(robot, "has it", now, then, bool(failed), "has this value already")
    if not failed:
        return Outlook(robot, "unharmed", now, then, False)
    if 2 * sum(run.is_helped for run in failed) > len(failed):
        return Outlook(robot, "helped", now, then, True)
    rival = next((one for run in failed if (one := run.row.main) and one.what != "parameter"), None)
    return Outlook(robot, "not helped", now, then, True, "" if rival is None else rival.name)


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return fmean(known) if known else None


def _is_good(one: Suggestion) -> bool:
    """Whether it helps at least two robots, more than half of those that fail, and harms none."""
    helped = len(one.having("helped"))
    return helped >= FEWEST and 2 * helped > one.failing and not one.having("harmed")


def _worth(one: Suggestion) -> tuple[bool, int, float]:
    helped = one.having("helped")
    return _is_good(one), len(helped), round(_mean([outlook.then for outlook in helped]) or 0.0, 2)


def _why_not(best: Suggestion) -> str:
    change, units = f"{best.option.name} {best.option.show(best.value)}", f"{best.unit}s"
    helped, harmed = best.having("helped"), best.having("harmed")
    if not helped:
        what = "any" if best.unit == "run" else "most failures of any"
        return f"no single value of a parameter would repair {what} of the {best.failing} {units} that fail"
    told = f"{change} would help {len(helped)} of the {best.failing} {units} that fail"
    if harmed:
        return f"{told}, and harm {len(harmed)} that did well with what they have"
    return f"the best single change is not enough: {told}"

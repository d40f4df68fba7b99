"""What would this run have done with other options? Built once per run, then asked at every key press."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from operator import not_

import numpy as np

from care_core.causal.counterfactual import Config, CounterfactualQuery
from care_core.configs.driven import option_value
from care_core.diagnose.blame import blame
from care_core.diagnose.fixes import change_notes, prediction
from care_core.diagnose.judging import Judged, facing_mission, query_of
from care_core.diagnose.noisy_or import NoisyOr
from care_core.diagnose.parts import is_ahead
from care_core.diagnose.promise import Promise
from care_core.diagnose.records import ObjectiveResult, Odds, Prediction
from care_core.ecosystems.findings import NOTHING_SEEN, Health
from care_core.ecosystems.ranking import lost_by
from care_core.errors import UsageError, nearest
from care_core.numbers import Floats
from care_core.profile.schema import Schema
from care_core.profile.store import Profile
from care_core.records import Record
from care_core.run import ProfileChoice, Run, Setting
from care_core.variables import Change, Role, Variable

ACROSS = 24
"""Values of one option that are asked for, from one end of its range to the other."""
NO_MISSION_HINT = "Ask with the log of a mission, or with another flight of this one: --mission N."


class Outlook(Record):
    """One objective under the changes, beside what this run had."""

    objective: ObjectiveResult
    predicted: Prediction
    now: Prediction
    """Predicted for the run's own configuration: what another run without changes would give."""


class Answer(Record):
    """What the changes are predicted to do. The probability is that of meeting every threshold."""

    changes: tuple[Change, ...]
    """With the warnings of each value: out of range, outside the training runs, looser than a safety default."""
    outlooks: tuple[Outlook, ...]
    p_ok: float
    p_ok_now: float

    @property
    def is_guess(self) -> bool:
        """Whether a value leaves the training runs, which is said beside every probability."""
        return not all(change.in_support for change in self.changes)


class Over(Record):
    """The answers for the values of one option."""

    option: Variable
    current: float
    answers: tuple[tuple[float, Answer], ...]


class Question(Record, eq=False):
    """A run ready to be asked "what if"; `ask` is pure and takes milliseconds."""

    profile: ProfileChoice
    schema: Schema
    run: Run
    query: CounterfactualQuery
    objectives: tuple[ObjectiveResult, ...]
    lost_by: tuple[str, ...] = ()
    """What this run was lost by and no prediction knows of."""
    failure: NoisyOr | None = None
    """The causes that may have lost this run; None where nothing was lost."""

    def ask(self, changes: Mapping[str, float]) -> Answer:
        """The prediction for this run with these options changed; option names must be the profile's."""
        query = self.query
        config = {**query.config, **changes}
        then, now = self._odds([config, query.config])
        outlooks = tuple(
            Outlook(result, prediction(query, name, config), prediction(query, name, query.config))
            for result in self.objectives
            if (name := result.variable.name) in query.model.outcomes
        )
        least = min((one.predicted.p_ok for one in outlooks if one.predicted.p_ok is not None), default=1.0)
        return Answer(
            changes=tuple(
                Change(
                    self.schema.variables[name],
                    query.config[name],
                    value,
                    self.warnings(name, value),
                    query.model.supports(name, value),
                    name in query.assumed,
                )
                for name, value in changes.items()
            ),
            outlooks=outlooks,
            p_ok=min(float(then), least),
            p_ok_now=float(now),
        )

    def over(self, name: str, beside: Mapping[str, float]) -> Iterator[tuple[float, Answer]]:
        """The predictions for values of one option across its range, beside other changes."""
        for value in self._values_of(name):
            yield value, self.ask({**beside, name: value})

    def odds_over(self, name: str, beside: Mapping[str, float]) -> tuple[Odds, ...]:
        """The odds of these answers alone, of all values at once: without intervals that nobody reads of a curve."""
        query, values = self.query, self._values_of(name)
        changes = [{**beside, name: value} for value in values]
        configs = [{**query.config, **change} for change in changes]
        p_ok, together = self._odds(configs), query.probability(configs)
        for result in self.objectives:
            if result.name in query.model.outcomes:  # of one without a threshold it is not a number
                p_ok = np.fmin(p_ok, np.maximum(query.p_ok(result.name, configs), together))
        in_support = [all(query.model.supports(*item) for item in change.items()) for change in changes]
        return tuple(Odds(*one) for one in zip(values, p_ok.tolist(), map(not_, in_support), strict=True))

    def _values_of(self, name: str) -> list[float]:
        """Values across the range of an option, those of this run and of its reference among them."""
        option, query = self.schema.variables[name], self.query
        known = (query.config.get(name), query.reference.get(name))
        return sorted({*option.across(ACROSS), *(value for value in known if value is not None)})

    def _odds(self, configs: Sequence[Config]) -> Floats:
        """Probability that every objective is met: of a run that failed as its report promises it."""
        if self.failure is None:
            return self.query.probability(configs)
        broken = [result.variable.name for result in self.objectives if result.status == "fault"]
        return Promise(self.failure, self.query, broken).odds(configs)

    def warnings(self, name: str, value: float) -> tuple[str, ...]:
        """What speaks against believing or setting this value."""
        option = self.schema.variables[name]
        found = []
        if not option.accepts(value):
            found.append(f"outside the acceptable values ({option.acceptable})")
        if not self.query.model.supports(name, value):
            summary = self.query.model.summaries[name]
            found.append(f"outside the training runs ({summary.low:g} to {summary.high:g}): a guess")
        if not any(name in mechanism.inputs for mechanism in self.query.model.mechanisms.values()):
            found.append("no effect was seen in training")
        untold = [pair[1] for pair, one in self.query.model.effects.items() if pair[0] == name and not one.identified]
        if untold:
            found.append(f"the training runs cannot tell what it does to {', '.join(untold)}")
        elif self.schema.observational:
            found.append("operators chose it in training: what made them choose may have done what is put down to it")
        if name in self.query.assumed:
            found.append("no source holds its value: it is assumed to be at its reference")
        return (*found, *change_notes(option))


def question(judged: Judged, profile: Profile, choice: ProfileChoice, health: Health = NOTHING_SEEN) -> Question:
    """Get a run ready to be asked. Raises UsageError for one without a mission, whose outcome nobody can predict."""
    if judged.run.checks:
        raise UsageError("No mission was flown, so no outcome of one can be predicted.", hint=NO_MISSION_HINT)
    query = query_of(judged, profile)
    failure = blame(judged, profile, query, health).failure if judged.broken else None
    if is_ahead(judged.run, health.findings):
        query = facing_mission(query, judged, profile)
    asked = Question(
        profile=choice,
        schema=profile.schema,
        run=judged.run,
        query=query,
        objectives=judged.results,
        lost_by=lost_by(health.findings, is_judged=bool(judged.broken)),
        failure=failure,
    )
    asked.ask({})  # The mechanisms invert their covariance when first asked, which nobody should wait for at a key.
    return asked


def parse_change(text: str, schema: Schema) -> tuple[str, float]:
    """`OPTION=VALUE` as an operator types it: the option or one of its parameters; true and labels are values too.

    Raises:
        UsageError: no such option (the nearest is named), no such value, or one that is not acceptable.
    """
    name, _, value = (part.strip() for part in text.partition("="))
    option = option_named(name, schema)
    number = option_value(option, Setting(option.name, value, "--set"))
    if number is None:
        raise UsageError(
            f"'{text}' sets no value.",
            hint=f"Write {option.name}=VALUE; acceptable are {option.acceptable}.",
            where="--set",
        )
    if not option.accepts(number):
        raise UsageError(f"{option.name} cannot be {value}.", hint=f"Ask for {option.acceptable}.", where="--set")
    return option.name, number


def ask_over(question: Question, name: str, beside: Mapping[str, float]) -> Over:
    """What the values of one option would bring, beside other changes.

    Raises:
        UsageError: no such option, or one of which no range is known.
    """
    option = option_named(name, question.schema, "--over")
    if not option.across(ACROSS):
        raise UsageError(
            f"Nothing says between which values {option.name} may be.", hint="Ask for one with --set.", where="--over"
        )
    others = {changed: value for changed, value in beside.items() if changed != option.name}
    return Over(option, question.query.config[option.name], tuple(question.over(option.name, others)))


def option_named(name: str, schema: Schema, where: str = "--set") -> Variable:
    """An option by its name or by one of its parameters. Raises UsageError, which names the nearest."""
    variable = schema.variables.get(name)
    if variable is not None and variable.role is Role.OPTION:
        return variable
    by_parameter = {parameter: option for option in schema.options for parameter in option.parameters}
    if name in by_parameter:
        return by_parameter[name]
    if variable is not None:
        how = "met" if variable.role is Role.CONTEXT else "measured"
        raise UsageError(f"{name} is {how}, not set.", hint="Only parameters can be set.", where=where)
    names = [option.name for option in schema.options]
    folded = {known.casefold(): known for known in names}
    close = folded.get(name.casefold())
    hint = f"Did you mean '{close}'?" if close else nearest(name, [*names, *by_parameter])
    hint = hint or f"List them with 'care profiles show {schema.name}'."
    raise UsageError(f"The profile has no parameter '{name}'.", hint=hint, where=where)

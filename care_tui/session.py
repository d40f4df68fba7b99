"""What the operator has opened and chosen so far. Values only: pages show it, workers fill it."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

from care_core.application.case import Case
from care_core.application.deciding import changes_of, decided, fixes, weighed_without
from care_core.application.signals import Signal
from care_core.configs.driven import as_number
from care_core.diagnose.estimates import WORTH
from care_core.diagnose.records import Cause, Diagnosis, Fault, Fix, Hypothesis, ObjectiveResult
from care_core.errors import CareError
from care_core.records import Struct, field, replace
from care_core.report.formats import FILE_FORMATS, Format
from care_core.variables import Variable
from care_tui.basket import Basket

State = Literal["empty", "loading", "data", "error"]


class Session(Struct, eq=False):
    """One log on its way from the fault to the report. A new log gets a new session."""

    path: Path | None = None
    progress: tuple[str, float] | None = None
    case: Case | None = None
    error: CareError | None = None
    not_remembered: CareError | None = None
    """Why the diagnosis could not be put into the history."""
    looked_at: str | None = None
    """The objective that the operator was at when the log was asked to be judged again."""
    objective: int = 0
    """Place of the objective that the causes are shown of."""
    option: str | None = None
    """The option that the operator came to the fix with."""
    basket: Basket = field(default_factory=Basket)
    fix: Fix | None = None
    """What the ticked changes are predicted to bring; None while it is computed."""
    fix_error: CareError | None = None
    tried: dict[tuple[str, float], float] = field(default_factory=dict)
    """Odds of one change alone, of those that the operator ticked: option and value to probability."""
    unchanged: Fix | None = None
    """What the configuration as driven would bring again."""
    signals: list[Signal] | None = None
    """The signals of the log, once somebody asked for them."""
    dismissed: dict[str, str] = field(default_factory=dict)
    """Causes set aside: option to reason."""
    _options: list[Variable] | None = None
    _before_aside: dict[str, dict[str, float]] = field(default_factory=dict)
    """Options that left the fix when they were set aside, with what was ticked before."""
    format: Format = FILE_FORMATS[0]

    @property
    def state(self) -> State:
        if self.case is not None:
            return "data"
        if self.error is not None:
            return "error"
        return "empty" if self.path is None else "loading"

    @property
    def is_readable(self) -> bool:
        """Whether there is a log to look into, though it may have no diagnosis."""
        return self.case is not None or (self.state == "error" and self.path is not None and os.path.exists(self.path))

    @property
    def diagnosis(self) -> Diagnosis:
        """The diagnosis; only asked for in the state `data`."""
        assert self.case is not None
        return self.case.diagnosis

    def take(self, case: Case) -> None:
        """A diagnosis has come: start at its first fault, with the suggested fix in the basket."""
        self.case, self._options, self.tried = case, None, {}
        names = [result.variable.name for result in case.diagnosis.objectives]
        statuses = [result.status for result in case.diagnosis.objectives]
        self.objective = statuses.index("fault") if "fault" in statuses else 0
        if self.looked_at in names:
            self.objective = names.index(self.looked_at)
        self.fix = case.diagnosis.fix
        if self.fix is not None:
            self.basket = Basket(changes_of(self.fix), self.suggested())
        elif case.diagnosis.faults:
            self.basket = Basket({}, self.suggested())

    def suggested(self) -> dict[str, float]:
        """A value for every option that the engine would change: in a fix, an alternative, or for a cause."""
        values: dict[str, float] = {}
        suggested, *others = [changes_of(fix) for fix in fixes(self.diagnosis)] or [{}]
        causes = [cause for fault in self.diagnosis.faults for cause in fault.causes]
        alone = {cause.option.name: cause.suggested for cause in causes if cause.suggested is not None}
        for found in (suggested, alone, *others):
            values = {**values, **{name: value for name, value in found.items() if name not in values}}
        return values

    def alone(self) -> dict[tuple[str, float], float]:
        """Probability of keeping all thresholds with one option alone at a value: that suggested for it as a cause, and
        those that were tried."""
        causes = [cause for fault in self.diagnosis.faults for cause in fault.causes]
        suggested = {
            (c.option.name, c.suggested): c.p_fixed for c in causes if not (c.suggested is None or c.p_fixed is None)
        }
        return suggested | self.tried

    def asked(self) -> list[dict[str, float]]:
        """The changes whose odds are asked for: what is ticked, and where that is several each alone."""
        ticked = self.basket.ticked
        each = [{name: value} for name, value in ticked.items()] if len(ticked) > 1 else []
        return [dict(ticked), *each]

    def predicted(self, fixes: Sequence[Fix]) -> None:
        """What was asked has its answers."""
        self.fix = fixes[0]
        for changes, odds in ((changes_of(fix), fix.odds) for fix in fixes):
            if len(changes) == 1 and odds is not None:
                self.tried |= dict.fromkeys(changes.items(), odds)

    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """What explains the failure, the causes set aside left out and the others weighed anew."""
        return weighed_without(self.diagnosis, self.dismissed).hypotheses

    def weighed_case(self) -> Case:
        """The case as what was set aside leaves it; only asked for in the state `data`."""
        assert self.case is not None
        return replace(self.case, diagnosis=weighed_without(self.diagnosis, self.dismissed))

    def odds_unchanged(self) -> float | None:
        """Probability that the next run is without a fault as driven; None where that is not known."""
        return self.diagnosis.odds_as_driven if self.unchanged is None else self.unchanged.odds

    def first_fault(self) -> bool:
        """Turn to the first objective whose fault has causes; False when there is none."""
        places = [i for i, result in enumerate(self.diagnosis.objectives) if self.fault_of(result)]
        if places:
            self.objective = places[0]
        return bool(places)

    def empty_steps(self) -> tuple[str, ...]:
        """Steps that have nothing to show of this run: Enter passes them over."""
        if self.state != "data":
            return ()
        diagnosis = self.diagnosis
        is_judged, can_change = bool(diagnosis.objectives), diagnosis.profile.fit.verdict != "no"
        can_change = (can_change and not diagnosis.run.checks) or diagnosis.fix is not None
        empty = () if is_judged else ("objectives",)
        if not diagnosis.hypotheses and not can_change:
            empty = (*empty, "causes")
        return empty if can_change else (*empty, "fix", "diff")

    @property
    def result(self) -> ObjectiveResult | None:
        """The objective that the causes are shown of."""
        results = self.diagnosis.objectives
        return results[self.objective] if results else None

    @property
    def fault(self) -> Fault | None:
        """The fault of that objective, if it has one."""
        result = self.result
        return None if result is None else self.fault_of(result)

    def fault_of(self, result: ObjectiveResult) -> Fault | None:
        name = result.variable.name
        return next((fault for fault in self.diagnosis.faults if fault.objective.variable.name == name), None)

    @property
    def causes(self) -> tuple[Cause, ...]:
        return () if self.fault is None else self.fault.causes

    def set_aside(self, option: str, reason: str) -> bool:
        """Set a cause aside; True when that changed the fix: the best one without it is ticked, where one is left that
        is worth its change."""
        self.dismissed[option], self.tried = reason, {}
        if option not in self.basket.ticked:
            return False
        self._before_aside[option] = dict(self.basket.ticked)
        driven = self.diagnosis.odds_as_driven or 0.0
        others = [
            changes_of(fix)
            for fix in fixes(self.diagnosis)
            if not set(changes_of(fix)) & set(self.dismissed) and (fix.odds or 0.0) >= driven + WORTH.value
        ]
        self.basket.load(others[0] if others else {})
        return True

    def take_back(self, option: str) -> bool:
        """Undo `set_aside`; True when that put the option back into the fix."""
        del self.dismissed[option]
        self.tried = {}
        before = self._before_aside.pop(option, None)
        if before is None or option in self.basket.ticked:
            return False
        self.basket.load(before)
        return True

    def next_fault(self) -> bool:
        """Turn to the next faulty objective, the first after the last; False when there is no other."""
        places = [i for i, result in enumerate(self.diagnosis.objectives) if self.fault_of(result)]
        if len(places) < 2:
            return False
        self.objective = next((place for place in places if place > self.objective), places[0])
        return True

    def options(self) -> list[Variable]:
        """Every option, those that the engine would change first."""
        if self._options is None:
            self._options = self._sorted_options()
        return self._options

    def _sorted_options(self) -> list[Variable]:
        known = {option.name: option for option in (self.case.options if self.case else ())}
        for fix in fixes(self.diagnosis):
            known |= {change.option.name: change.option for change in fix.changes}
        known |= {cause.option.name: cause.option for fault in self.diagnosis.faults for cause in fault.causes}
        first = [name for name in self.suggested() if name in known]
        return [known[name] for name in (*first, *(name for name in known if name not in first))]

    def current(self, option: Variable) -> float | None:
        """The option's value in this run; where no source holds it, what the engine took it to be."""
        run, reference = self.diagnosis.run, self._reference()
        if option.name not in reference and (setting := run.left_at(option.name)) is not None:
            return as_number(setting.value)
        return run.config.get(option.name, reference.get(option.name, option.default))

    def reference(self, option: Variable) -> float | None:
        """The value of the configuration that the run is held against; None where there is none."""
        return self._reference().get(option.name, option.default)

    def _reference(self) -> Mapping[str, float]:
        reading = self.case and self.case.reading
        return reading.judged.reference.config if reading else {}

    def is_assumed(self, option: Variable) -> bool:
        """Whether no source holds the option's value."""
        run = self.diagnosis.run
        return option.name not in run.config and option.name not in run.settings

    def decided(self) -> Diagnosis:
        """The diagnosis with the ticked changes as its fix, and the causes set aside."""
        return decided(self.diagnosis, self.fix, self.dismissed)

    def decided_case(self) -> Case:
        """The case with that diagnosis; only asked for in the state `data`."""
        assert self.case is not None
        return replace(self.case, diagnosis=self.decided())

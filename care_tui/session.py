"""What the operator has opened and chosen so far. Values only: pages show it, workers fill it."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from care_core.application.case import Case, changes_of, decided, fixes
from care_core.configs.driven import as_number
from care_core.diagnose.records import Cause, Diagnosis, Fault, Fix, ObjectiveResult
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
    unchanged: Fix | None = None
    """What the configuration as driven would bring again."""
    dismissed: dict[str, str] = field(default_factory=dict)
    """Causes set aside: option to reason."""
    _left_fix: set[str] = field(default_factory=set)
    """Options that left the fix when they were set aside."""
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
        return self.case is not None or (self.state == "error" and self.path is not None and self.path.exists())

    @property
    def diagnosis(self) -> Diagnosis:
        """The diagnosis; only asked for in the state `data`."""
        assert self.case is not None
        return self.case.diagnosis

    def take(self, case: Case) -> None:
        """A diagnosis has come: start at its first fault, with the suggested fix in the basket."""
        self.case = case
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
        """Probability of keeping all thresholds with one option alone at the value suggested for it as a cause."""
        causes = [cause for fault in self.diagnosis.faults for cause in fault.causes]
        return {
            (c.option.name, c.suggested): c.p_fixed for c in causes if not (c.suggested is None or c.p_fixed is None)
        }

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
        """Set a cause aside; True when that took its option out of the fix."""
        self.dismissed[option] = reason
        if option not in self.basket.ticked:
            return False
        self._left_fix.add(option)
        self.basket.drop(option)
        return True

    def take_back(self, option: str) -> bool:
        """Undo `set_aside`; True when that put the option back into the fix."""
        del self.dismissed[option]
        if option not in self._left_fix:
            return False
        self._left_fix.remove(option)
        return option not in self.basket.ticked and self.basket.toggle(option)

    def next_fault(self) -> bool:
        """Turn to the next faulty objective, the first after the last; False when there is no other."""
        places = [i for i, result in enumerate(self.diagnosis.objectives) if self.fault_of(result)]
        if len(places) < 2:
            return False
        self.objective = next((place for place in places if place > self.objective), places[0])
        return True

    def options(self) -> list[Variable]:
        """Every option, those that the engine would change first."""
        known = {option.name: option for option in (self.case.options if self.case else ())}
        for fix in fixes(self.diagnosis):
            known |= {change.option.name: change.option for change in fix.changes}
        known |= {cause.option.name: cause.option for fault in self.diagnosis.faults for cause in fault.causes}
        first = [name for name in self.suggested() if name in known]
        return [known[name] for name in (*first, *(name for name in known if name not in first))]

    def current(self, option: Variable) -> float | None:
        """The option's value in this run; where no source holds it, what the engine took it to be."""
        run, reading = self.diagnosis.run, self.case and self.case.reading
        reference = reading.judged.reference.config if reading else {}
        if option.name not in reference and (setting := run.settings.get(option.name)) is not None:
            return as_number(setting.value)
        return run.config.get(option.name, reference.get(option.name, option.default))

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

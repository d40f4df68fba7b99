"""A judged run whose log stays open: what views, plots, bundles and reports look into."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from care_core.errors import CareError
from care_core.records import Record, replace

if TYPE_CHECKING:
    from care_core.causal.model import Model
    from care_core.configs.loading import ConfigFile
    from care_core.diagnose.judging import Judged
    from care_core.diagnose.records import Diagnosis
    from care_core.diagnose.whatif import Question
    from care_core.ecosystems.findings import Health
    from care_core.logs.base import Log
    from care_core.profile.schema import Schema
    from care_core.profile.store import Profile
    from care_core.run import ProfileChoice
    from care_core.variables import Variable


class Reading(Record, eq=False, dict=True):
    """A log read by a profile and judged: what every question about a run begins with."""

    profile: Profile
    choice: ProfileChoice
    configs: tuple[ConfigFile, ...]
    judged: Judged
    health: Health

    @cached_property
    def question(self) -> Question:
        """The run ready to be asked what other options would have done."""
        from care_core.diagnose.whatif import question

        return question(self.judged, self.profile, self.choice, self.health)


class OpenRun(Record, eq=False):
    """A diagnosis with what is needed to ask more about it. The log was opened and digested once, and stays open."""

    diagnosis: Diagnosis
    options: tuple[Variable, ...] = ()
    """Every option of the profile, in its order."""
    log: Log | None = None
    reading: Reading | None = None
    """None where no profile fits the log."""
    configs: tuple[str | Path, ...] = ()
    """Configuration files that the operator named."""

    @property
    def schema(self) -> Schema | None:
        return None if self.reading is None else self.reading.profile.schema

    @property
    def model(self) -> Model | None:
        return None if self.reading is None else self.reading.profile.model


def log_of(case: OpenRun) -> Log:
    """The log of a run, which is open. Raises CareError where there is none."""
    if case.log is None:
        raise CareError("There is no log to look into.", hint="Open one.")
    return case.log


def question_of(case: OpenRun) -> Question:
    """What a run can be asked. Raises CareError where there is no model of it."""
    if case.reading is None:
        raise CareError("There is no model to ask.", hint="Open a log that a profile with a model fits.")
    return replace(case.reading.question, failure=case.diagnosis.failure)

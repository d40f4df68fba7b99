"""What screens, steps and workers tell each other: past-tense facts with a typed payload."""

from __future__ import annotations

from dataclasses import dataclass

from textual.message import Message

from care_core.diagnose.records import Cause, Diagnosis
from care_core.errors import CareError


@dataclass
class Progressed(Message):
    """The engine reached a step; `fraction` of the whole work is done (0 to 1)."""

    step: str
    fraction: float

    def can_replace(self, message: Message) -> bool:
        return isinstance(message, Progressed)


@dataclass
class DiagnosisReady(Message):
    """The engine has an answer."""

    diagnosis: Diagnosis


@dataclass
class DiagnosisFailed(Message):
    """The engine has no answer."""

    error: CareError


@dataclass
class StepChosen(Message):
    """The operator wants to see another step of the walk, counted from 1."""

    step: int


@dataclass
class ObjectiveChosen(Message):
    """The operator wants the causes of an objective."""

    index: int


@dataclass
class CauseChosen(Message):
    """The operator wants the fix of a cause."""

    cause: Cause


@dataclass
class FixChosen(Message):
    """The operator looks at a fix, which diff and report follow; 0 is the suggested one."""

    index: int


@dataclass
class DiffReady(Message):
    """The diff of the chosen fix, or why there is none."""

    text: str | CareError


@dataclass
class ReportReady(Message):
    """The report in the chosen format, or why there is none."""

    text: str | CareError


@dataclass
class ReportWritten(Message):
    """Where the report went."""

    path: str

"""What pages and workers tell the screen: past-tense facts and wishes with a typed payload."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from textual.message import Message

from care_core.application.case import Request
from care_core.application.proof import Subject


@dataclass
class Progressed(Message):
    """The engine reached a step; `fraction` of the whole work is done (0 to 1)."""

    request: Request
    step: str
    fraction: float

    def can_replace(self, message: Message) -> bool:
        return isinstance(message, Progressed)


@dataclass
class Answered(Message):
    """A worker has an answer to a question, or the CareError that says why it has none."""

    question: str
    answer: Any


@dataclass
class Go(Message):
    """The operator wants another page, at a moment of the log or at the proof of something where one is named."""

    page: str
    moment_s: float | None = None
    subject: Subject | None = None


@dataclass
class OpenLog(Message):
    """Another log is to be opened."""

    path: Path
    mission: int | None = None
    """Which of its missions, None for the one that was asked for before, else the last."""


@dataclass
class Judge(Message):
    """The log is to be judged as this request says; the operator waits at `page`, and comes back to `objective`."""

    request: Request
    page: str = "log"
    objective: str | None = None


@dataclass
class Decided(Message):
    """The operator ticked a change or set a cause aside: what follows from it is to be told anew."""

    has_changed_fix: bool = True

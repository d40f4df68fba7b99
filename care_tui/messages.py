"""What screens, widgets and workers tell each other: past-tense facts with a typed payload."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from textual.message import Message

from care_tui.jobs import Job


@dataclass
class Progressed(Message):
    """The engine reached a step; `fraction` of the whole work is done (0 to 1)."""

    step: str
    fraction: float

    def can_replace(self, message: Message) -> bool:
        return isinstance(message, Progressed)


@dataclass
class Fetched(Message):
    """A worker has an answer, or the CareError that says why it has none; `receive` takes it on the screen's side."""

    job: Job
    receive: Callable[[Any], None]
    answer: Any


@dataclass
class StepChosen(Message):
    """The operator wants to see another step of the walk, counted from 1."""

    step: int

"""Errors that the firmware says again and again while the vehicle is armed."""

from __future__ import annotations

import re
from typing import NamedTuple

from care_core.ecosystems.base import Limits
from care_core.ecosystems.px4.flight import Px4Flight, is_complaint
from care_core.ecosystems.spans import Span

LIMITS = Limits()
OFTEN = LIMITS.add("errors alike", 20.0, "", "a choice: a part that recovers is complained of a few times")
_LEVELS = frozenset(("ERROR", "CRITICAL", "ALERT", "EMERGENCY"))
_NUMBER = re.compile(r"\d+")
_SPEAKER = re.compile(r"^\[(\w+)\]\s*")


class Repeated(NamedTuple):
    """An error that was said again and again."""

    text: str
    """With its speaker, and N for each of its numbers."""
    times: tuple[float, ...]

    @property
    def shown(self) -> str:
        return f"{self.text} ({len(self.times)} times)"


def most_repeated(flight: Px4Flight, span: Span) -> Repeated | None:
    """The error that was said most in a span, but for refusals to arm; None where none was said often."""
    said: dict[str, list[float]] = {}
    for t, level, text in flight.messages:
        if span[0] <= t <= span[1] and level.upper() in _LEVELS and not is_complaint(text):
            said.setdefault(_SPEAKER.sub(r"\1: ", _NUMBER.sub("N", text)), []).append(t)
    most = max(said.items(), key=lambda one: len(one[1]), default=("", []))
    return Repeated(most[0], tuple(most[1])) if len(most[1]) >= OFTEN else None

"""Parameters as the tables of vehicles read them: by name, whatever the caller keeps of each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from care_core.run import Setting

Driven = Mapping[str, float | str] | Mapping[str, Setting] | Mapping[str, tuple[Setting, ...]]
"""Per parameter its value, its setting, or the history of its settings (the first counts: a frame never changes)."""


def number(settings: Driven, name: str) -> float | None:
    """The number that a parameter has, None where it is absent or no number."""
    held: object = settings.get(name)
    if isinstance(held, Sequence) and not isinstance(held, str):
        held = held[0] if held else None
    if isinstance(held, Setting):
        held = held.value
    return float(held) if isinstance(held, (int, float)) else None


def code(settings: Driven, name: str) -> int | None:
    """A parameter that stands for a choice."""
    value = number(settings, name)
    return None if value is None or not value.is_integer() else int(value)

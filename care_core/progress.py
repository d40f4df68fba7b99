"""How far long work has come, for whoever waits."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str, float], None]
"""Told what is done now, and which share of all is behind it."""


def silent(_step: str, _share: float) -> None:
    """For whom nobody waits."""

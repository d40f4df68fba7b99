"""Probabilities as bars that are read in a second. Every bar has its number beside it."""

from __future__ import annotations

from textual.content import Content

from care_core.text import percent
from care_tui.render.rows import Glyphs

WIDTH = 10
LIKELY, EVEN = 0.8, 0.5
"""From here on something is likely; below that it is as good as a coin at best."""


def bar(share: float, glyphs: Glyphs, width: int = WIDTH, style: str = "$text-accent") -> Content:
    """So much of the width is filled; a share that is not nothing fills a cell."""
    filled = min(max(round(share * width), 1 if share > 0 else 0), width)
    return Content.assemble((glyphs.done * filled, style), (glyphs.ahead * (width - filled), "dim"))


def odds_style(share: float) -> str:
    """The colour of a promise: only one that is likely to be kept is green."""
    return "$text-success" if share >= LIKELY else "$text-warning" if share >= EVEN else "$text-error"


def promise(share: float, glyphs: Glyphs, width: int = WIDTH) -> Content:
    """`████████░░  86%`, by how likely it is that it is kept."""
    style = odds_style(share)
    return Content.assemble(bar(share, glyphs, width, style), Content.styled(f" {percent(share):>4}", f"bold {style}"))

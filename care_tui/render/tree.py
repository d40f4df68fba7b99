"""A tree of causes or effects, a line a variable, with what each was in the run."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator

from textual.content import Content

from care_core.causal.tree import Branch
from care_tui.render.rows import FEW_RESAMPLES, Glyphs, Row, cut, text

EFFECT, VALUE = 6, 14
"""Cells of an effect, and of a value of the run."""
LEAST_NAME = 16


def tree_rows(
    tree: Branch, value_of: Callable[[str], str], marked: Collection[str], width: int, glyphs: Glyphs
) -> list[Row]:
    """The variable at the root, then each branch: name, value in the run, effect.

    Args:
        value_of: what a variable was in the run, with its unit.
        marked: variables of the path that explains the run.
    """
    room = max(width - EFFECT - VALUE - 3, LEAST_NAME)
    named = [("", tree), *_below(tree, "", glyphs)]
    rows = []
    for stem, branch in named:
        sign = f"{glyphs.root} " if branch.name in marked else ""
        style = "bold $text-accent" if branch.name in marked else "bold" if not stem else ""
        again = f" {glyphs.more}" if branch.is_elsewhere else ""
        name = cut(Content.assemble((stem, "dim"), text(f"{sign}{branch.name}", style), (again, "dim")), room, glyphs)
        line = name.pad_right(room - name.cell_length) + text(f" {value_of(branch.name):>{VALUE}}")
        if branch.edge is not None:
            few = branch.edge.support < FEW_RESAMPLES
            line += Content.styled(f" {branch.edge.signed_effect:>+{EFFECT}.2f}", "dim" if few else "")
            line += Content("?" if few else "")
        rows.append(Row(line))
    return rows


def _below(tree: Branch, stem: str, glyphs: Glyphs) -> Iterator[tuple[str, Branch]]:
    """The branches from the top down, each with the lines that lead to it."""
    for branch in tree.branches:
        is_last = branch is tree.branches[-1]
        yield f"{stem}{glyphs.corner if is_last else glyphs.tee}{glyphs.rule} ", branch
        yield from _below(branch, f"{stem}   " if is_last else f"{stem}{glyphs.line}  ", glyphs)

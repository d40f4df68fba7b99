"""Changes of options in the words of an ecosystem: as a diff of its files, and as commands."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence

from care_core.configs.driven import option_value, parameter_value, readable
from care_core.configs.formats import format_for
from care_core.ecosystems.dialect import Dialect
from care_core.run import Run
from care_core.text import clean
from care_core.variables import Change, Variable


def unified_diff(run: Run, changes: Sequence[Change], *, by_hand: bool = False) -> str:
    """The configuration as driven against the changes, in the ecosystem's own format; only keys that change.

    Args:
        by_hand: the operator chose them.
    """
    line_of = format_for(run.log.format, run.settings).functions.line_of
    driven, fixed = {}, {}
    for option, parameter, suggested in _assignments(changes):
        change = next(change for change in changes if change.option is option)
        current: float | None = change.current
        if change.is_assumed:
            setting = run.settings.get(parameter)
            current = None if setting is None else option_value(option, setting)
        if current is not None:
            driven[parameter] = line_of(option, parameter, parameter_value(option, current))
        fixed[parameter] = line_of(option, parameter, suggested)
    lines = difflib.unified_diff(
        [driven[parameter] for parameter in sorted(driven)],
        [fixed[parameter] for parameter in sorted(fixed)],
        fromfile="as driven",
        tofile="chosen by hand" if by_hand else "suggested",
        n=0,
        lineterm="",
    )
    return "".join(f"{clean(line)}\n" for line in lines)


def apply_commands(changes: Iterable[Change], format: Dialect) -> list[str]:
    """Shell or ground station commands that make the changes."""
    commands: list[str] = format.functions.commands(_assignments(changes))
    return commands


def _assignments(changes: Iterable[Change]) -> tuple[tuple[Variable, str, float], ...]:
    return tuple(
        (change.option, parameter, parameter_value(change.option, change.suggested))
        for change in changes
        for parameter in readable(change.option)
    )

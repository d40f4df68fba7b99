"""Signals of a log as small tables: few rows that still show what all would."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from care_core.application.plotting import ranked
from care_core.application.proof import meanings
from care_core.application.signals import Source, shown_lines, signals_of, whole_of
from care_core.errors import UsageError, nearest
from care_core.text import figures

if TYPE_CHECKING:
    from care_core.application.case import Case
    from care_core.application.signals import Line


def signal_list(case: Case) -> str:
    """A line for each signal of a log, those first that matter to its diagnosis."""
    if case.log is None:
        return "The log holds no signals."
    groups, telling = ranked(case)
    meaning_of = meanings(case)
    start_s, end_s = whole_of(case)
    lines = [f"the mission is from {figures(start_s, 5)} to {figures(end_s, 5)} s of the log"]
    for place, group in enumerate(groups):
        for one in group:
            meaning = meaning_of(one.channel, one.field)
            about = ", ".join(part for part in (meaning.label, meaning.unit) if part)
            wanted = f", was to follow {one.wanted_name}" if one.wanted else ""
            mark = "*" if place < telling else " "
            lines.append(f"{mark} {one.name}{f': {about}' if about else ''}{wanted}")
    return "\n".join((*lines, "* matters to this diagnosis"))


def signal_table(case: Case, names: Sequence[str], start_s: float, end_s: float, rows: int) -> str:
    """Signals over a span of the log, a row for each part of it: the mean with the least and the greatest value.

    Args:
        end_s: the end of the mission where it is 0.

    Raises:
        UsageError: the log has no such signal, or the span is empty.
    """
    whole = whole_of(case)
    span = (start_s or (0.0 if end_s else whole[0])), end_s or whole[1]
    if span[1] <= span[0]:
        raise UsageError(f"From {span[0]:g} to {span[1]:g} s there is nothing.", hint="Give start_s below end_s.")
    known: dict[str, Source] = {}
    for one in signals_of(case):
        known[one.name] = one.channel, one.field
        if one.wanted is not None:
            known[" ".join(one.wanted)] = one.wanted
    for name in names:
        if name not in known:
            hint = nearest(name, known) or "Call 'signals' without names: it lists them."
            raise UsageError(f"The log has no signal '{name}'.", hint=hint)
    found = shown_lines(case, [known[name] for name in names], span)
    columns = [list(_parts(found[known[name]], span, rows)) for name in names]
    head = ",".join(("from_s", "to_s", *(f"{name} {part}" for name in names for part in ("mean", "min", "max"))))
    step = (span[1] - span[0]) / rows
    lines = [
        ",".join((f"{span[0] + row * step:.2f}", f"{span[0] + (row + 1) * step:.2f}", *(one[row] for one in columns)))
        for row in range(rows)
    ]
    return "\n".join((head, *lines))


def _parts(line: Line | None, span: tuple[float, float], rows: int) -> Iterator[str]:
    """Mean, least and greatest value of each part of a span, as cells; empty ones where there is no value."""
    import numpy as np

    t, values = line if line is not None else (np.empty(0), np.empty(0))
    place = np.clip(((t - span[0]) / (span[1] - span[0]) * rows).astype(int), 0, rows - 1)
    for row in range(rows):
        part = values[place == row]
        numbers = (part.mean(), part.min(), part.max()) if len(part) else ()
        yield ",".join(figures(float(number), 4) for number in numbers) or ",,"

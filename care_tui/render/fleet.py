"""The fleet as a table of 80 columns."""

from __future__ import annotations

from io import StringIO

from rich.console import Console
from rich.table import Table
from rich.text import Text

from care_core.diagnose.verdict import STATUS_WORDS
from care_core.fleet.fleet_report import Fleet
from care_core.fleet.rows import Row, copies_of
from care_core.report.fleet import counted, main_words, run_name, shared_lines, short_names, suggestion_lines
from care_core.text import WIDTH, clean

MOST_ROWS = 60
"""Of a larger fleet the rows that need a look come first, and the others are counted."""
_WORST_FIRST = ("fault", "unreadable", "not_evaluated", "ok")


def fleet_text(fleet: Fleet) -> str:
    """The table, what its rows share, and the change that would help most of them."""
    short = short_names(fleet.rows)
    lines = [counted(fleet), "", *_table(fleet, short), "", *shared_lines(fleet, short)]
    return "\n".join([*lines, *suggestion_lines(fleet, short)]) + "\n"


def _table(fleet: Fleet, short: dict[str, str]) -> list[str]:
    rows = list(enumerate(fleet.rows))
    if len(rows) > MOST_ROWS:
        rows.sort(key=lambda one: _WORST_FIRST.index(one[1].status))
    shown, copies = rows[:MOST_ROWS], copies_of(fleet.rows)
    has_robot = any(row.robot for _, row in shown)
    has_date = any(row.start for _, row in shown)
    table = Table(box=None, padding=(0, 1, 0, 0), show_edge=False, expand=True, header_style="")
    if has_robot:
        table.add_column("robot", max_width=10, overflow="fold")
    table.add_column("run", max_width=22, overflow="fold")
    if has_date:
        table.add_column("date", width=10)
    table.add_column("verdict", max_width=18, overflow="fold")
    table.add_column("explained by, found", ratio=1, overflow="fold")
    for place, row in shown:
        cells = [short.get(row.robot or "", "")] if has_robot else []
        cells += [run_name(row.log)]
        cells += [(row.start or "")[:10]] if has_date else []
        cells += [_verdict(row), f"a copy of {run_name(copies[place])}" if place in copies else _why(row)]
        table.add_row(*(Text(clean(cell)) for cell in cells))
    out = StringIO()
    Console(file=out, width=WIDTH, color_system=None, highlight=False, legacy_windows=False).print(table)
    lines = [line.rstrip() for line in out.getvalue().splitlines()]
    left = len(rows) - len(shown)
    return [*lines, *([f"and {left} more: --json or --parquet holds all"] if left else [])]


def _verdict(row: Row) -> str:
    return f"{STATUS_WORDS[row.status]} {', '.join(row.breaches)}".rstrip()


def _why(row: Row) -> str:
    """What explains a failure, and the gravest finding that is not that; why nothing could be judged."""
    told = [main_words(row.main)] if row.main else []
    told += [f"{row.explained[0].name}? ({row.explained[0].probability:.0%})"] if not told and _guess(row) else []
    explained = {one.name for one in row.explained[:1]}
    findings = sorted(row.findings, key=lambda one: one.severity != "critical")
    told += [one.title for one in findings if one.title not in explained][:1]
    if row.status in ("not_evaluated", "unreadable") and row.reason:
        told.insert(0, row.reason)
    return "; ".join(told)


def _guess(row: Row) -> bool:
    return bool(row.explained) and row.explained[0].what != "chance" and bool(row.explained[0].name)

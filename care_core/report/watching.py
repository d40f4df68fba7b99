"""`care.watch/1`: what `care watch` says of one finished log, as a line of JSON and as a line for people."""

from __future__ import annotations

import unicodedata
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, Literal

from care_core.diagnose.records import Hypothesis
from care_core.diagnose.verdict import STATUS_WORDS, RunStatus
from care_core.records import field
from care_core.report.document import remembered_verdict
from care_core.report.published import Document, publish
from care_core.report.reading import remembered
from care_core.run import FitVerdict, Robot
from care_core.text import WIDTH, clean

SCHEMA_ID: Final = "care.watch/1"
NO_ROBOT = "-"
"""Where a log does not say whose it is."""

_NUMBER, _VERDICT = 3, max(map(len, STATUS_WORDS.values()))
_ROBOT_SHARE, _LOG_SHARE = 0.18, 0.27
"""Of the columns of a line; the cause takes what is left."""


class WatchEntry(Document, kw_only=True):
    """One log. `says` is the likeliest cause, or why nothing is judged; `unfinished` why it was judged though nobody
    closed it; `is_new` is false where another watcher judged it, or an earlier call of `care`."""

    schema_: Literal["care.watch/1"] = field(default=SCHEMA_ID, name="schema")
    number: int
    at: str
    log: str
    sha256: str | None
    robot: Robot | None
    verdict: RunStatus
    says: str
    explanation: Hypothesis | None
    faults: list[str]
    profile: str | None
    fit: FitVerdict | None
    unfinished: str | None
    is_new: bool


def judged_entry(
    number: int,
    at: str,
    past: Mapping[str, Any],
    robot: Robot | None,
    *,
    unfinished: str = "",
    is_new: bool = True,
) -> WatchEntry:
    """The entry of a triage, by its document `care.triage/1` as it is remembered."""
    document = remembered(past)
    verdict = remembered_verdict(document)
    return WatchEntry(
        number=number,
        at=at,
        log=clean(document.log.path),
        sha256=document.log.sha256,
        robot=None if robot is None else publish(Robot, robot),
        verdict=verdict.status,
        says=verdict.in_short,
        explanation=next(iter(document.hypotheses), None),
        faults=[one.name for one in document.objectives if one.status == "fault"],
        profile=document.profile.name if document.profile else None,
        fit=document.fit.verdict,
        unfinished=unfinished or None,
        is_new=is_new,
    )


def unread_entry(number: int, at: str, log: Path, reason: str, *, sha256: str | None, unfinished: str) -> WatchEntry:
    """The entry of a log that could not be read, and why."""
    return WatchEntry(
        number=number, at=at, log=clean(str(log)), sha256=sha256, robot=None, verdict="unreadable", says=clean(reason),
        explanation=None, faults=[], profile=None, fit=None, unfinished=unfinished or None, is_new=True,
    )  # fmt: skip


def entry_line(entry: WatchEntry, clock: str, width: int | None, *, ascii: bool = False) -> str:
    """The entry on one line for people: time, number, verdict, robot, cause, log. `width` in columns, None: as long as
    it is."""
    word = STATUS_WORDS[entry.verdict]
    robot = entry.robot.name if entry.robot else NO_ROBOT
    name = Path(entry.log).name
    remarks = [f"unfinished: {entry.unfinished}"] if entry.unfinished else []
    remarks += [] if entry.is_new else ["judged before"]
    says = "; ".join((*([entry.says] if entry.says else []), *remarks))
    if width is None:
        return "  ".join((clock, f"{entry.number:>{_NUMBER}}", word, robot, says or "-", entry.log))
    dots = "..." if ascii else "…"
    name = _cut(name, int(width * _LOG_SHARE), dots, keep_end=True)
    wide = int(width * _ROBOT_SHARE)
    start = f"{clock} {entry.number:>{_NUMBER}} {word:<{_VERDICT}} {_padded(_cut(robot, wide, dots), wide)} "
    room = width - _columns(start) - _columns(name) - 1
    return f"{start}{_padded(_cut(says, room, dots), room)} {name}".rstrip()


def log_lines(logs: Sequence[tuple[Path, RunStatus, str]], width: int = WIDTH) -> list[str]:
    """Several logs that were triaged, a line each: verdict, what explains it, log."""
    names = [_cut(clean(path.name), width // 3, "...", keep_end=True) for path, *_ in logs]
    room = width - _VERDICT - max(map(_columns, names), default=0) - 4
    return [
        f"{STATUS_WORDS[status]:<{_VERDICT}}  {_padded(_cut(clean(says) or '-', room, '...'), room)}  {name}"
        for name, (_, status, says) in zip(names, logs, strict=True)
    ]


def _columns(text: str) -> int:
    """Columns that a text takes in a terminal."""
    return sum(
        0 if unicodedata.combining(one) else 2 if unicodedata.east_asian_width(one) in "WF" else 1 for one in text
    )


def _padded(text: str, width: int) -> str:
    return text + " " * (width - _columns(text))


def _cut(text: str, width: int, dots: str, *, keep_end: bool = False) -> str:
    """The text in at most `width` columns; what is left out is marked at its end, or in a name before its end."""
    if _columns(text) <= width:
        return text
    left = max(width - len(dots), 0)
    while _columns(text) > left:
        text = text[1:] if keep_end else text[:-1]
    return (f"{dots}{text}" if keep_end else f"{text}{dots}")[: max(width, 0)]

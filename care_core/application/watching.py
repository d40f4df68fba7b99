"""Waiting for finished logs in folders and triaging each, once, in a process of its own.

A log that crashes, hangs or fills the memory costs that process alone. What is done is in the history, by content, so a
new start, a new name or a second watcher triages nothing again.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from datetime import datetime, timezone
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from care_core.application.case import Request, open_case
from care_core.application.history_writing import about_run, options_of, terms_of
from care_core.diagnose.verdict import exit_code
from care_core.errors import CareError, ExitCode
from care_core.history.store import About, History, HistoryError
from care_core.history.watched import WatchBook
from care_core.logs.digest import log_digest
from care_core.logs.finished import ABANDONED_S, QUIET_S, FileStatus, StabilityTimeout, is_as_it_was, is_one, look
from care_core.parallel import Failed, each
from care_core.records import Record, Struct, field, replace
from care_core.report.watching import WatchEntry, judged_entry, unread_entry

LIMIT_S = 600.0
EVERY_S, _LEAST_S = 2.0, 0.1
"""Seconds between two looks, less where a log need not rest for long."""
_LOOKING_SHARE = 0.1
"""Of the time, at most so much is spent on looking: a large folder on a slow mount is looked at less often."""
_CLAIM_S = 60.0
"""A claim is believed for so long beyond the time that a log may take."""

Triage = tuple[dict[str, Any], int, About]
"""The document, the number of its mission, and what else is remembered."""


class Task(Record):
    """What is to be watched, and how each log is to be judged."""

    folders: tuple[Path, ...]
    profile: str | None = None
    thresholds: Mapping[str, float] = field(default_factory=dict)
    site: Path | None = None
    robot: str | None = None
    quiet_s: float = QUIET_S
    abandoned_s: float = ABANDONED_S
    limit_s: float = LIMIT_S
    """Seconds that one log may take."""


class Watcher(Struct, eq=False, dict=True):
    """Looks, and gives an entry for each log that is finished and was not dealt with. `history` None: nothing is kept
    beyond this process."""

    task: Task
    history: History | None
    tell: Callable[[str], None]
    """Is told in a sentence of what is no log's fault."""
    clock: Callable[[], float] = time.monotonic
    triage: Callable[[Path, Task], Triage | Failed] = field(default_factory=lambda: triage_apart)
    known: int = 0
    """Logs that were done before this watcher first looked."""
    waiting: tuple[FileStatus, ...] = ()
    """Logs that were there at the last look and not finished."""
    _handled: dict[Path, str] = field(default_factory=dict)
    """Per log the stamp that it had when it was dealt with."""
    _taken: set[Path] = field(default_factory=set)
    """Logs that another watcher was at when this one came to them."""
    _first: frozenset[Path] | None = None
    """Logs that were there at the first look."""
    _there: set[Path] | None = None
    _number: int = 0

    @cached_property
    def _patience(self) -> StabilityTimeout:
        return StabilityTimeout(self.task.quiet_s, self.task.abandoned_s)

    @cached_property
    def _terms(self) -> str:
        return terms_of(_request(Path(), self.task))

    def look(self) -> Iterator[WatchEntry]:
        """One look at the folders."""
        self._mention_folders()
        sights = look(self.task.folders)
        if self._first is None:
            self._first = frozenset(sight.path for sight in sights)
        left = [sight for sight in sights if self._handled.get(sight.path) != sight.stamp]
        for sight in self._patience.rested(left, self.clock()):
            entry = self._deal_with(sight)
            if entry is not None:
                yield entry
        self.waiting = tuple(sight for sight in left if self._handled.get(sight.path) != sight.stamp)

    def pause_s(self, looked_s: float) -> float:
        """How long to wait after a look that took so long."""
        return max(min(EVERY_S, self.task.quiet_s / 2), _LEAST_S, looked_s / _LOOKING_SHARE)

    @property
    def is_shared(self) -> bool:
        """Whether another watcher is at a log that is waited for."""
        return any(sight.path in self._taken for sight in self.waiting)

    def _mention_folders(self) -> None:
        there = {folder for folder in self.task.folders if folder.is_dir()}
        before = set(self.task.folders) if self._there is None else self._there
        for folder in self.task.folders:
            if folder in before - there:
                self.tell(f"{folder} is not there: waiting for it")
            elif folder in there - before:
                self.tell(f"{folder} is there again")
        self._there = there

    def _deal_with(self, sight: FileStatus) -> WatchEntry | None:
        stamp = f"{sight.path.absolute()};{sight.stamp}"
        if not is_one(sight.path):
            self._handled[sight.path] = sight.stamp
            return None
        if self._ask(lambda ledger: ledger.is_done(stamp), False):
            self._handled[sight.path] = sight.stamp
            self.known += 1
            return None
        try:
            sha256 = log_digest(sight.path)
        except CareError as err:
            if not is_as_it_was(sight):  # gone or written to: it is looked at again
                return None
            return self._unread(sight, err.message, None)
        claim = self._ask(lambda ledger: ledger.claim(sha256, sight.path, stamp, self.task.limit_s + _CLAIM_S), "mine")
        if claim == "taken":
            self._taken.add(sight.path)
            return None
        if claim == "done":
            return self._before(sight, sha256)
        return self._triage(sight, sha256)

    def _triage(self, sight: FileStatus, sha256: str) -> WatchEntry | None:
        try:
            answer = self.triage(sight.path, self.task)
            is_same = is_as_it_was(sight)
        except BaseException:
            self._ask(lambda ledger: ledger.release(sha256), None)
            raise
        if not is_same:  # what was read is half of it
            self._ask(lambda ledger: ledger.release(sha256), None)
            return None
        if isinstance(answer, Failed):
            reason, is_final = answer.reason, answer.is_final
            self._ask(lambda ledger: ledger.failed(sha256, reason, is_final=is_final), None)
            return self._unread(sight, reason, sha256)
        document, mission, about = answer
        self._ask(lambda ledger: ledger.done(document, mission, about), None)
        self._handled[sight.path] = sight.stamp
        return judged_entry(self._next(), _now(), document, about.robot, unfinished=sight.open_by)

    def _before(self, sight: FileStatus, sha256: str) -> WatchEntry | None:
        """A log that is done already: those that were there from the start are only counted, unless another watcher
        has done it just now."""
        was_taken = sight.path in self._taken
        self._taken.discard(sight.path)
        self._handled[sight.path] = sight.stamp
        if not was_taken and self._first is not None and sight.path in self._first:
            self.known += 1
            return None
        history = self.history
        past = None if history is None else self._ask(lambda _: history.triage_of(sha256, self._terms), None)
        if past is None:
            return None
        entry = judged_entry(self._next(), _now(), past.document, past.robot, is_new=False)
        return replace(entry, log=str(sight.path))

    def _unread(self, sight: FileStatus, reason: str, sha256: str | None) -> WatchEntry:
        self._handled[sight.path] = sight.stamp
        return unread_entry(self._next(), _now(), sight.path, reason, sha256=sha256, unfinished=sight.open_by)

    def _ask(self, question: Callable[[WatchBook], Any], without: Any) -> Any:
        """Ask the ledger. A history that cannot be used costs a sentence, never the work."""
        if self.history is None:
            return without
        try:
            return question(WatchBook(self.history, self._terms))
        except HistoryError as err:
            self.tell(f"care: {err}")
            return without

    def _next(self) -> int:
        self._number += 1
        return self._number


def triage_apart(path: Path, task: Task) -> Triage | Failed:
    """The triage of one log in a process of its own."""
    with closing(each(partial(triage_one, task=task), [path], workers=1, limit_s=task.limit_s)) as answers:
        return next(answer for _, answer in answers)


def triage_one(path: Path, *, task: Task) -> Triage:
    """The triage of one log, as plain values that can be sent between processes. Raises CareError."""
    from care_core.report.document import build_document
    from care_core.report.writers import published

    request = _request(path, task)
    diagnosis = open_case(request, lambda _step, _share: None).diagnosis
    about = replace(about_run(diagnosis.run), judged_with=options_of(request))
    return published(build_document(diagnosis)), diagnosis.run.mission.index, about


def _request(path: Path, task: Task) -> Request:
    return Request(path, task.profile, thresholds=task.thresholds, site=task.site, robot=task.robot)


def overall_code(entries: Sequence[WatchEntry], waiting: int) -> ExitCode:
    """The exit code of a whole look; a log that is not finished counts as one that could not be judged."""
    verdicts = {entry.verdict for entry in entries}
    return exit_code(*verdicts, "not_evaluated") if waiting else exit_code(*verdicts)


def _now() -> str:
    return datetime.now(timezone.utc).isoformat(timespec="seconds")

"""What `care watch` has done, in the history: by what a log holds, so that neither a new name nor a new start counts.

Watchers of one history share the work: a log is claimed before it is triaged, and marked as done in the transaction
that remembers the triage. A claim ends with the process that holds it.
"""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from care_core.files import read_small_text
from care_core.history.store import JUDGED_BY, About, History, insert_triage, judged_by
from care_core.records import Record, replace

Claim = Literal["mine", "done", "taken"]
"""What became of a claim: it is granted; the log is done already; another watcher is at it."""

MOST_ATTEMPTS = 3
"""A log whose triage ended the program, or took too long, so often is not tried again."""


class WatchBook(Record):
    """The book that the watchers of a history keep. Every call may raise HistoryError."""

    history: History
    terms: str = ""
    """What this watcher judges by beside the profile, as `About.terms`: what another judged otherwise is not done."""

    def is_done(self, stamp: str) -> bool:
        """Whether a log was dealt with that lay in the same place, as long and as old: told without reading it."""
        with self.history.reading() as connection:
            rows = connection.execute(
                "select 1 from watched where stamp = ? and (state in ('done', 'failed') or attempts >= ?) limit 1",
                (self._own(_storable(stamp)), MOST_ATTEMPTS),
            )
            return rows.fetchone() is not None

    def claim(self, sha256: str, path: Path, stamp: str, valid_s: float) -> Claim:
        """Ask for a log. `valid_s`: how long a claim of a process on another computer is believed, in seconds."""
        key = self._own(sha256)
        with self.history.writing() as connection:
            row = connection.execute(
                "select state, attempts, holder, until from watched where log_sha256 = ?", (key,)
            ).fetchone()
            known = connection.execute(
                f"select 1 from triages where {JUDGED_BY} limit 1", judged_by(sha256, self.terms)
            ).fetchone()
            state, attempts, holder, until = row or ("new", 0, "", 0.0)
            if state == "claimed" and holder != _holder() and _is_at_work(holder, until):
                return "taken"
            done = state in ("done", "failed") or attempts >= MOST_ATTEMPTS or (known is not None and state == "new")
            new = "done" if done and state != "failed" else state if done else "claimed"
            connection.execute(
                "insert or replace into watched values (?, ?, ?, ?, ?, ?, ?, coalesce("
                "(select reason from watched where log_sha256 = ?), ''))",
                (
                    key,
                    _storable(str(path)),
                    self._own(_storable(stamp)),
                    new,
                    attempts + (not done),
                    _holder(),
                    time.time() + valid_s,
                    key,
                ),
            )
            return "done" if done else "mine"

    def release(self, sha256: str) -> None:
        """Give a log back untouched: the work was broken off, or the log changed meanwhile."""
        with self.history.writing() as connection:
            connection.execute(
                "update watched set state = 'left', attempts = attempts - 1 where log_sha256 = ? and holder = ?",
                (self._own(sha256), _holder()),
            )

    def done(self, document: Mapping[str, Any], mission: int, about: About) -> None:
        """Remember a triage and that its log is done: both or neither."""
        with self.history.writing() as connection:
            insert_triage(connection, document, mission, replace(about, terms=self.terms))
            key = self._own(document["log"]["sha256"])
            connection.execute("update watched set state = 'done' where log_sha256 = ?", (key,))

    def failed(self, sha256: str, reason: str, *, is_final: bool) -> None:
        """Remember that a log could not be read. Where the log itself is not at fault, a later start tries again."""
        with self.history.writing() as connection:
            connection.execute(
                "update watched set state = ?, reason = ? where log_sha256 = ?",
                ("failed" if is_final else "left", reason, self._own(sha256)),
            )

    def _own(self, text: str) -> str:
        return f"{text};{self.terms}" if self.terms else text


def _storable(name: str) -> str:
    """A name with the bytes that are no UTF-8 as escapes: a database holds text."""
    return name.encode("utf-8", "backslashreplace").decode("utf-8")


def _holder() -> str:
    """This process, told from any that gets its number later."""
    return f"{socket.gethostname()}:{os.getpid()}:{_started(os.getpid())}"


def _is_at_work(holder: str, until: float) -> bool:
    host, pid, started = holder.rsplit(":", 2)
    if host != socket.gethostname():
        return time.time() < until
    try:
        os.kill(int(pid), 0)
    except ProcessLookupError:
        return False
    except OSError:  # another user's
        return True
    return _started(int(pid)) == started


def _started(pid: int) -> str:
    """When a process was started, in ticks since the system was; empty where that is not told."""
    try:
        return read_small_text(Path(f"/proc/{pid}/stat"), errors="replace").rpartition(")")[2].split()[19]
    except (OSError, IndexError):
        return ""

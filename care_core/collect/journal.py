"""What a campaign has planned and done, one JSON object a line, kept on the disk as it happens.

First what it is the journal of; then `{"plan": [...]}` before any of those runs starts, and `{"run": ...}` when one is
done. Whatever ends the program costs at most the runs that were under way. A line that was cut off is taken away.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

from care_core.collect.sampling import Planned
from care_core.errors import UsageError
from care_core.files import open_to_append
from care_core.records import Record, Struct, field, plain
from care_core.tables.rows import TableRow

FILE = "journal.jsonl"
FORMAT = "care.collect.journal/1"


class Done(Record):
    """A run that is over: its rows (one a mission), or why there are none."""

    run: int
    attempts: int
    time_s: float
    logs: tuple[str, ...] = ()
    rows: tuple[TableRow, ...] = ()
    failure: str = ""
    unread: tuple[str, ...] = ()
    """Logs that could not be read beside those that could, and why."""
    ignored: tuple[str, ...] = ()
    """Options that were driven otherwise than asked, as the log says."""


class Journal(Struct, eq=False):
    """The journal of a campaign's folder, held by one process at a time. Close it, or use it as a context manager."""

    planned: dict[int, Planned] = field(default_factory=dict)
    done: dict[int, Done] = field(default_factory=dict)
    _stream: BinaryIO | None = None

    @classmethod
    def open(cls, folder: Path, digest: str) -> Journal:
        """The journal in a folder, begun where there is none.

        Raises:
            UsageError: it is another campaign's, another process holds it, or it cannot be written.
        """
        path = folder / FILE
        try:
            stream = open_to_append(path)
        except OSError as err:
            raise UsageError(f"Cannot write the journal: {err.strerror}.", where=str(path)) from err
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as err:
            stream.close()
            hint = "Wait for it, or choose another folder with --out."
            raise UsageError("Another 'care collect' is at work there.", hint=hint, where=str(folder)) from err
        journal = cls(_stream=stream)
        try:
            journal._read(stream, digest, path)
        except BaseException:
            stream.close()
            raise
        return journal

    def _read(self, stream: BinaryIO, digest: str, path: Path) -> None:
        stream.seek(0)
        content = stream.read()
        whole, lines = 0, []
        for line in content.splitlines(keepends=True):
            entry = _entry(line)
            if entry is None:
                break
            lines.append(entry)
            whole += len(line)
        if b"\n" in content[whole:].rstrip(b"\n"):  # not the last line: the runs behind it must not go with it
            raise _damaged(path, len(lines) + 1)
        if not lines:
            if content.strip():
                raise UsageError("This is no journal of a campaign.", hint="Choose another --out.", where=str(path))
            self._write({"journal": FORMAT, "campaign": digest})
            return
        if lines[0] != {"journal": FORMAT, "campaign": digest}:
            raise UsageError(
                "These are the runs of another campaign, or of this one before it was changed.",
                hint="Choose another folder with --out; slots, limits on time, retries and the command may change.",
                where=str(path),
            )
        stream.truncate(whole)
        for number, entry in enumerate(lines[1:], start=2):
            try:
                for one in entry.get("plan", ()):
                    self.planned[one["number"]] = Planned(**one)
                if "run" in entry:
                    self.done[entry["run"]] = _done(entry)
            except (TypeError, LookupError, ValueError, AttributeError) as err:
                raise _damaged(path, number) from err

    def plan(self, runs: Sequence[Planned]) -> None:
        """Keep what is to be run next."""
        self._write({"plan": [plain(run) for run in runs]})
        self.planned.update({run.number: run for run in runs})

    def add(self, done: Done) -> None:
        """Keep a run that is over."""
        self._write(plain(done))
        self.done[done.run] = done

    def _write(self, entry: Mapping[str, Any]) -> None:
        if self._stream is None:
            raise ValueError("the journal is closed")
        try:
            self._stream.write(json.dumps(entry).encode() + b"\n")
            self._stream.flush()
            os.fsync(self._stream.fileno())
        except OSError as err:
            hint = "Make room on the disk and give the same command again."
            raise UsageError(f"Cannot write the journal: {err.strerror}.", hint=hint, where=self._stream.name) from err

    def close(self) -> None:
        if self._stream is not None:
            with suppress(OSError):
                self._stream.close()
            self._stream = None

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _damaged(path: Path, line: int) -> UsageError:
    return UsageError(
        f"The journal of the campaign is damaged in line {line}.",
        hint="Take the line out, or choose another folder with --out.",
        where=str(path),
    )


def _entry(line: bytes) -> Any:
    """What a line says; None where it was cut off."""
    try:
        return json.loads(line) if line.endswith(b"\n") else None
    except ValueError:
        return None


def _done(entry: Mapping[str, Any]) -> Done:
    return Done(**{**entry, **{key: tuple(entry[key]) for key in ("logs", "rows", "unread", "ignored")}})

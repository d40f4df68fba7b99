"""Many logs to one table of runs, on all cores, resumable: what is done is kept in a journal beside the table.

A journal is one JSON object a line: first what it was read for, then a line a log. It is appended to as logs are done,
so whatever ends the program costs at most the logs that were being read. A line that was cut off is not read.
"""

from __future__ import annotations

import hashlib
import json
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from functools import partial
from io import TextIOWrapper
from itertools import takewhile
from pathlib import Path
from typing import Any, TextIO

from care_core import limits
from care_core.errors import LogError, UsageError
from care_core.extract.select import fitting_profile, sound_profiles
from care_core.files import open_regular, open_to_append
from care_core.folders import files_in
from care_core.logs.opening import open_log
from care_core.outputs import REMOVE_HINT, write_output
from care_core.parallel import Failed, each
from care_core.profile.schema import Schema
from care_core.profile.store import load_profile
from care_core.progress import Progress
from care_core.records import Record, Struct, field
from care_core.tables.rows import TableRow, rows_of
from care_core.text import csv_table, none_of_logs


class Failure(Record):
    """A log that gave no runs, and why."""

    path: Path
    reason: str


class Ingested(Struct, eq=False):
    """The rows and failures of logs, in the order in which the logs were named; `resumed` of them were done before."""

    rows: list[TableRow] = field(default_factory=list)
    failures: list[Failure] = field(default_factory=list)
    resumed: int = 0


_LONGEST_LINE = limits.SMALL_FILE_BYTES
"""Bytes of a line of a journal: a log of a thousand missions has so many."""
_PACE_LOGS = 5
"""So many logs say how long the rest will take."""


def journal_of(out: Path) -> Path:
    """Where the journal of a table lies."""
    return out.with_name(f"{out.name}.part")


def ingest(
    paths: Sequence[Path],
    schema: Schema,
    out: Path,
    *,
    workers: int | None = None,
    limit_s: float = 600.0,
    progress: Progress,
    read: Callable[[Path, Schema], list[TableRow]] = rows_of,
) -> Ingested:
    """Read every log, going on with what `journal_of(out)` holds. The caller removes the journal when all is written.

    Args:
        limit_s: seconds that one log may take.
        read: gives the rows of a log, one a mission.
    """
    known = _read_journal(journal_of(out), _purpose(schema))
    keys = {path: _key(path) for path in paths}
    done: dict[Path, list[TableRow] | Failed] = {path: known[key] for path, key in keys.items() if key in known}
    resumed, left = len(done), [path for path in paths if path not in done]
    failed = sum(isinstance(answer, Failed) for answer in done.values())
    since = 0.0  # when the first answer came: until then the processes were started
    answers = each(partial(_read_one, schema=schema, read=read), left, workers=workers, limit_s=limit_s)
    with _writing(journal_of(out), _purpose(schema), known) as journal, closing(answers):
        for place, answer in answers:
            path = left[place]
            done[path] = answer if isinstance(answer, Failed) else _shared(answer)
            failed += isinstance(answer, Failed)
            if not isinstance(answer, Failed) or answer.is_final:
                journal.write(_line(keys[path], answer))
                journal.flush()
            since = since or time.monotonic()
            pace_s = (time.monotonic() - since) / max(len(done) - resumed - 1, 1)
            progress(_progress_line(len(done), failed, len(paths), len(done) - resumed, pace_s), len(done) / len(paths))
    return _collected(paths, done, resumed)


def failures_table(failures: Sequence[Failure]) -> str:
    """The failures as CSV with the columns log and reason."""
    return csv_table([("log", "reason"), *((str(failure.path), failure.reason) for failure in failures)])


def by_reason(failures: Sequence[Failure]) -> list[tuple[str, int, Path]]:
    """(reason, how many logs, the first of them), the most frequent reason first."""
    counts = Counter(failure.reason for failure in failures)
    first = {failure.reason: failure.path for failure in reversed(failures)}
    return [(reason, count, first[reason]) for reason, count in counts.most_common()]


def _read_one(path: Path, *, schema: Schema, read: Callable[[Path, Schema], list[TableRow]]) -> list[TableRow]:
    return read(path, schema)


def _collected(paths: Sequence[Path], done: Mapping[Path, list[TableRow] | Failed], resumed: int) -> Ingested:
    found = Ingested(resumed=resumed)
    for path in paths:
        answer = done[path]
        if isinstance(answer, Failed):
            found.failures.append(Failure(path, answer.reason))
        else:
            found.rows.extend(answer)
    return found


def _shared(rows: list[TableRow]) -> list[TableRow]:
    """The rows with one string a variable for all: each that came from a process or a file has brought its own, which
    take half of its memory."""
    return [{sys.intern(name): value for name, value in row.items()} for row in rows]


def _progress_line(done: int, failed: int, count: int, now: int, pace_s: float) -> str:
    read = f"read {done} of {count} logs, {failed} failed"
    if now < _PACE_LOGS:
        return read
    left_s = pace_s * (count - done)
    left = f"{left_s / 60:.0f} min" if left_s >= 90 else f"{left_s:.0f} s"
    return f"{read}, about {left} left"


def _purpose(schema: Schema) -> dict[str, str]:
    """What rows depend on beside the log."""
    mission = hashlib.sha256(repr(sorted(schema.mission.items())).encode()).hexdigest()
    return {"journal": "care.ingest/1", "profile": schema.name, "variables": schema.digest, "mission": mission}


def _key(path: Path) -> str:
    """A log as it is now: a file that grew or was replaced is another one."""
    files = files_in(path) if path.is_dir() else [path]
    try:
        stats = [file.stat() for file in files]
    except OSError:  # reading it says what is wrong
        stats = []
    return json.dumps([str(path), sum(s.st_size for s in stats), max((s.st_mtime_ns for s in stats), default=0)])


def _line(key: str, answer: list[TableRow] | Failed) -> str:
    found = {"failure": answer.reason} if isinstance(answer, Failed) else {"rows": answer}
    return json.dumps({"log": key, **found}) + "\n"


def _read_journal(path: Path, purpose: Mapping[str, str]) -> dict[str, list[TableRow] | Failed]:
    """What an interrupted run had done; nothing where there is no journal, or one of another profile."""
    try:
        with open_regular(path) as stream:
            if _entry(stream.readline(_LONGEST_LINE)) != purpose:
                return {}
            entries = list(takewhile(bool, map(_entry, iter(partial(stream.readline, _LONGEST_LINE), b""))))
    except OSError:
        return {}
    try:
        return {e["log"]: _shared(e["rows"]) if "rows" in e else Failed(e["failure"], is_final=True) for e in entries}
    except (TypeError, LookupError, AttributeError):  # nobody's journal
        return {}


def _entry(line: bytes) -> Any:
    """What a line of the journal says; None where it was cut off."""
    try:
        return json.loads(line)
    except ValueError:
        return None


@contextmanager
def _writing(path: Path, purpose: Mapping[str, str], known: Mapping[str, list[TableRow] | Failed]) -> Iterator[TextIO]:
    """The journal, opened to append to what is known. Raises UsageError where it cannot be written."""
    try:
        begun = [json.dumps(purpose) + "\n", *(_line(key, answer) for key, answer in known.items())]
        write_output(path, "".join(begun), hint=REMOVE_HINT)
        with open_to_append(path) as raw, TextIOWrapper(raw, encoding="utf-8") as stream:
            yield stream
    except OSError as err:
        raise UsageError(
            f"Cannot write the journal: {err.strerror}.", hint="Choose another place.", where=str(path)
        ) from err


def schema_that_fits(paths: Sequence[Path], *, limit_s: float = 600.0) -> Schema:
    """The schema of the profile that fits the first log that any fits.

    Raises:
        LogError: no profile fits any of the logs.
    """
    with closing(each(_fitting_profile, paths, workers=1, limit_s=limit_s)) as answers:
        for _, answer in answers:
            if not isinstance(answer, Failed):
                return load_profile(answer).schema
    raise LogError(
        f"{none_of_logs(len(paths))} fits an installed profile.",
        hint="Look at one with 'care inspect', or name the profile with --profile.",
    )


def _fitting_profile(path: Path) -> Path:
    return fitting_profile(open_log(path), sound_profiles()[0])[0].path

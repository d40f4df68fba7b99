"""Telling somebody else of a judged log: a command of the operator's, started without a shell.

The words of the command are split once, when it is given. What a log or a report says is put into words, never into a
line that something splits again, so nothing in a log can add a word, an option or a command.
"""

from __future__ import annotations

import os
import re
import shlex
import signal
import subprocess
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from care_core.errors import UsageError, nearest
from care_core.records import Record
from care_core.report.watching import NO_ROBOT, WatchEntry
from care_core.starting import program_path

PLACES = ("log", "name", "verdict", "robot", "says", "profile", "sha256", "number")
"""What a command may name: {log} is the path of the log, {name} its last part."""
LIMIT_S = 30.0

_PLACE = re.compile(r"\{(\w+)\}")


class Notifier(Record):
    """The words of a command, and how many seconds it may take."""

    words: tuple[str, ...]
    limit_s: float = LIMIT_S

    def tell(self, entry: WatchEntry) -> str:
        """Run the command for an entry, which it is also given on its standard input as a line of JSON.

        Returns what went wrong in a sentence, empty where nothing did.
        """
        command = filled(self.words, entry)
        try:
            process = subprocess.Popen(
                [program_path(command[0]), *command[1:]],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                start_new_session=True,
            )
        except (OSError, ValueError) as err:
            return f"The command '{command[0]}' cannot be started: {getattr(err, 'strerror', None) or err}."
        try:
            _, said = process.communicate(entry.to_json(indent=None).encode(), timeout=self.limit_s)
        except subprocess.TimeoutExpired:
            return f"The command '{command[0]}' took longer than {self.limit_s:g} s and was ended."
        finally:
            _end(process)
        if process.returncode:
            last = next(iter(said.decode("utf-8", "replace").strip().splitlines()[-1:]), "")
            return f"The command '{command[0]}' ended with {process.returncode}{f': {last}' if last else ''}."
        return ""


def parse_notifier(text: str) -> Notifier:
    """A notifier out of what the operator typed.

    Raises:
        UsageError: a quote is not closed, there is no word, or a place is named that nothing is put into.
    """
    try:
        words = tuple(shlex.split(text))
    except ValueError as err:
        raise UsageError(f"The command cannot be split into words: {err}.", where="--notify-command") from err
    if not words:
        raise UsageError("The command is empty.", hint="Leave it out.", where="--notify-command")
    for place in _PLACE.findall(text):
        if place not in PLACES:
            hint = nearest(place, PLACES) or f"There are {', '.join(f'{{{one}}}' for one in PLACES)}."
            raise UsageError(f"There is no {{{place}}}.", hint=hint, where="--notify-command")
    if _PLACE.search(words[0]):
        raise UsageError("What a log says cannot be the command.", where="--notify-command")
    return Notifier(words)


def filled(words: Sequence[str], entry: WatchEntry) -> list[str]:
    """The words with what the entry says in its places; each stays one word, and no place makes one an option."""
    values = _values(entry)

    def fill(word: str) -> str:
        made = _PLACE.sub(lambda match: values.get(match[1], match[0]), word)
        return f" {made}" if made.startswith("-") and not word.startswith("-") else made

    return [words[0], *map(fill, words[1:])]


def _values(entry: WatchEntry) -> Mapping[str, str]:
    return {
        "log": str(Path(entry.log).absolute()),
        "name": Path(entry.log).name,
        "verdict": entry.verdict,
        "robot": entry.robot.name if entry.robot else NO_ROBOT,
        "says": entry.says,
        "profile": entry.profile or "",
        "sha256": entry.sha256 or "",
        "number": str(entry.number),
    }


def _end(process: subprocess.Popen[bytes]) -> None:
    """End what a command left, so that nothing of it outlives its notice."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    for stream in (process.stdin, process.stderr):
        if stream is not None:
            with suppress(OSError):
                stream.close()

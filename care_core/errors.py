"""Every error a user can meet, in one shallow tree.

    CareError
      UsageError        the command line asks for something that does not exist
        NoRepeatsError  several logs are not runs of one configuration
      LogError          the log cannot be read at all
      ProfileError      the profile is missing, unsound, or does not fit the log
      ConfigError       a configuration file cannot be read
      LearningError     the runs table cannot carry a model

Each says what is wrong in one sentence, what to do in one more, and where.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from enum import IntEnum


class ExitCode(IntEnum):
    """Process exit codes, an interface that other programs rely on."""

    OK = 0
    FAULT = 1
    USAGE = 2
    NOT_EVALUATED = 3
    UNREADABLE = 4
    INTERRUPTED = 130


class CareError(Exception):
    """Root of the tree: `message` (what is wrong), `hint` (what to do), `where` (file, topic or key)."""

    exit_code = ExitCode.USAGE

    def __init__(self, message: str, *, hint: str = "", where: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint
        self.where = where

    def __str__(self) -> str:
        place = f"{self.where}: " if self.where else ""
        hint = f" {self.hint}" if self.hint else ""
        return f"{place}{self.message}{hint}"


class UsageError(CareError):
    """The command line names something that does not exist."""


class NoRepeatsError(UsageError):
    """The logs are not of one configuration, so no answer is one for all of them."""


class LogError(CareError):
    """The log cannot be read at all."""

    exit_code = ExitCode.UNREADABLE


class ProfileError(CareError):
    """The profile is missing, unsound, or does not fit the log."""


class NoMissionError(ProfileError):
    """The log holds no mission that the profile can read: what happened in it can be told, nothing be judged."""


class ConfigError(CareError):
    """A configuration file cannot be read."""


class LearningError(CareError):
    """The runs table cannot carry a model."""


def nearest(word: str, known: Iterable[str], alike: float = 0.6) -> str:
    """A sentence that names the known word closest to `word`, whatever the case, or an empty string where none is
    `alike` enough (`difflib`'s ratio, from 0 to 1)."""
    spellings = {one.casefold(): one for one in known}
    close = get_close_matches(word.casefold(), list(spellings), n=1, cutoff=alike)
    return f"Did you mean '{spellings[close[0]]}'?" if close else ""

"""The tools: each calls what a command calls, and writes no file, no history and nothing to a robot."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Annotated

from pydantic import Field

import care_core
from care_core.application.case import Request
from care_core.errors import UsageError
from care_core.files import profile_folders
from care_core.text import figures
from care_tui.assistant.answers import part_of
from care_tui.assistant.folders import Folders

if TYPE_CHECKING:
    from care_core.application.case import Case

LogName = Annotated[str, Field(description="A log as 'logs' lists it, or its path.")]
Part = Annotated[int, Field(ge=1, description="Which part of a long answer.")]
ProfileName = Annotated[str, Field(description="An installed profile; chosen by the log if empty.")]
MissionNumber = Annotated[int, Field(ge=0, description="Which mission of the log, from 1; 0 is the last.")]
Configs = Annotated[
    list[str], Field(description="The robot's configuration files, [NAMESPACE=]FILE, for what the log lacks.")
]
MOST_LISTED, MOST_SIGNALS, MOST_ROWS = 200, 4, 100
_KEPT = 4
"""Cases that stay open, so that the next question about a log is answered at once."""


class Tools:
    """What an assistant may ask of the logs below some folders."""

    def __init__(self, folders: Sequence[Path]) -> None:
        """Raises UsageError for what is no folder."""
        self.folders = Folders(folders)
        self.lock = Lock()
        self._kept = lru_cache(_KEPT)(_opened)

    @property
    def every(self) -> tuple[Callable[..., str], ...]:
        """The tools; a tool is called as its method, and explained by its docstring."""
        return (
            self.logs,
            self.inspect,
            self.triage,
            self.what_if,
            self.compare,
            self.verify,
            self.signals,
            self.history,
            self.profiles,
        )

    def logs(self, part: Part = 1) -> str:
        """List the logs below the folders of this server, the newest first, with size and time. Start here."""
        return self._answer("logs", part, self._logs)

    def inspect(self, log: LogName, part: Part = 1) -> str:
        """Say what happened in a log and what it holds: span, channels, parameters, damage, missions, profiles."""

        def answer() -> str:
            from care_core.report.inspection import inspection_text

            return inspection_text(care_core.inspect(self.folders.file(log)))

        return self._answer("inspect", part, answer)

    def triage(
        self,
        log: LogName,
        profile: ProfileName = "",
        mission: MissionNumber = 0,
        since: Annotated[str, Field(description="The log of a good run: what changed, and judge against it.")] = "",
        config: Configs = [],  # noqa: B006  # never changed, and pydantic copies it
        part: Part = 1,
    ) -> str:
        """Find the fault of a run, what explains it with odds, the causes among its parameters, and a change to make.

        Probabilities are calibrated; NOT EVALUATED is never OK. A change is for a person to make: this server cannot.
        """
        return self._answer("triage", part, lambda: self._case(log, profile, mission, since, config).report())

    def what_if(
        self,
        log: LogName,
        changes: Annotated[dict[str, float], Field(description="Parameter to value, such as {'LAND_SPEED': 40}.")],
        profile: ProfileName = "",
        mission: MissionNumber = 0,
        config: Configs = [],  # noqa: B006
        part: Part = 1,
    ) -> str:
        """Predict what a run would have done with other values of its parameters, with intervals and odds."""

        def answer() -> str:
            from care_core.report.whatif import whatif_text

            case = self._case(log, profile, mission, "", config)
            found = care_core.what_if(case, changes)
            assert case.reading is not None  # else it could not be asked
            return whatif_text(case.reading.question, found)

        return self._answer("what_if", part, answer)

    def compare(self, a: LogName, b: LogName, profile: ProfileName = "", part: Part = 1) -> str:
        """Put two runs side by side, A the good one: parameters, what differs first, objectives, phases, findings."""

        def answer() -> str:
            one, other = (Request(self.folders.file(log), _profile(profile)) for log in (a, b))
            return care_core.compare(one, other).report()

        return self._answer("compare", part, answer)

    def verify(self, before: LogName, after: LogName, profile: ProfileName = "", part: Part = 1) -> str:
        """Tell whether the change that 'triage' advised for one run was made in a later one, and kept its promise."""

        def answer() -> str:
            from care_core.report.document import build_document
            from care_core.report.verification import verify_text

            promised = build_document(self._case(before, profile, 0, "", []).diagnosis)
            return verify_text(care_core.verify(promised, Request(self.folders.file(after), _profile(profile))))

        return self._answer("verify", part, answer)

    def signals(
        self,
        log: LogName,
        names: Annotated[
            list[str], Field(max_length=MOST_SIGNALS, description="As listed without any: 'CHANNEL FIELD'.")
        ] = [],  # noqa: B006
        start_s: Annotated[float, Field(description="Seconds from the start of the log.")] = 0.0,
        end_s: Annotated[float, Field(description="0 is the end of the mission.")] = 0.0,
        rows: Annotated[int, Field(ge=1, le=MOST_ROWS)] = 25,
        part: Part = 1,
    ) -> str:
        """List a log's signals, those first that matter to its diagnosis; or show some over time as a small table."""

        def answer() -> str:
            from care_tui.assistant.tables import signal_list, signal_table

            case = self._case(log, "", 0, "", [])
            return signal_table(case, names, start_s, end_s, rows) if names else signal_list(case)

        return self._answer("signals", part, answer)

    def history(
        self, limit: Annotated[int, Field(ge=1, le=MOST_LISTED, description="Triages listed.")] = 20, part: Part = 1
    ) -> str:
        """List past triages of these logs on this computer, with trends and how promised fixes turned out."""
        return self._answer("history", part, lambda: self._history(limit))

    def profiles(
        self, name: Annotated[str, Field(description="One of them, to see what it knows.")] = "", part: Part = 1
    ) -> str:
        """List the installed profiles; or show one: its parameters with ranges, its measures, objectives and limits."""

        def answer() -> str:
            from care_tui.commands.profiles import listed_profiles, shown_profile

            return shown_profile(_profile(name) or "") if name else listed_profiles()

        return self._answer("profiles", part, answer)

    def _answer(self, name: str, part: int, answer: Callable[[], str]) -> str:
        with self.lock:  # one at a time: a triage takes the whole machine
            return part_of(answer(), part, name)

    def _logs(self) -> str:
        from datetime import datetime, timezone

        found = self.folders.logs()
        if not found:
            return "There is no log in these folders."
        lines = []
        for path in found[:MOST_LISTED]:
            stat = path.stat()
            at = datetime.fromtimestamp(stat.st_mtime, timezone.utc).strftime("%Y-%m-%d %H:%M")
            size = "a folder" if path.is_dir() else f"{figures(stat.st_size / 1e6)} MB"
            lines.append(f"{at}  {size:>10}  {self.folders.shown(path)}")
        more = [f"and {len(found) - MOST_LISTED} older ones"] if len(found) > MOST_LISTED else []
        return "\n".join((*lines, *more))

    def _history(self, limit: int) -> str:
        from care_core.history.store import SWITCH, History, history_path
        from care_core.report.history import history_document, history_text

        path = history_path()
        if path is None or not path.is_file():
            return f"No triage is remembered here{f': {SWITCH} is off' if path is None else ''}."
        own = [one for one in History(path).triages() if self.folders.holds(one.log_path)]
        return history_text(history_document(own, (), limit), ascii=True, everything=True)

    def _case(self, log: str, profile: str, mission: int, since: str, config: Sequence[str]) -> Case:
        """The open case of a log; kept, as long as its files are what they were."""
        path, good = self.folders.file(log), self.folders.file(since) if since else None
        configs = tuple(self._config(one) for one in config)
        files = (path, *([good] if good else ()), *(Path(one.rpartition("=")[2]) for one in configs))
        request = (path, _profile(profile), mission or None, good, configs)
        return self._kept(request, tuple(_stamp(file) for file in files))

    def _config(self, name: str) -> str:
        """A configuration file as the engine wants it, its place checked."""
        namespace, equals, file = name.rpartition("=")
        return f"{namespace}{equals}{self.folders.file(file)}"


def _opened(request: tuple[Path, str | None, int | None, Path | None, tuple[str, ...]], _stamps: object) -> Case:
    path, profile, mission, since, configs = request
    return care_core.triage(Request(path, profile, configs, mission=mission, since=since))


def _stamp(path: Path) -> tuple[int, int]:
    found = path.stat()
    return found.st_mtime_ns, found.st_size


def _profile(name: str) -> str | None:
    """An installed profile alone: a folder could lie anywhere. Raises UsageError."""
    if name and name not in profile_folders():
        raise UsageError(f"There is no profile '{name}'.", hint=f"There are {', '.join(profile_folders())}.")
    return name or None

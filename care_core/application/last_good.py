"""The last good run of a robot that the history holds: what was changed since is evidence, as with `--since`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from care_core.history.store import Triaged
    from care_core.run import LogInfo, Robot, Setting


def last_good(robot: Robot | None, log: LogInfo) -> Mapping[str, Setting] | None:
    """The parameters of the last run of this robot before a log in which nothing failed, as far as the history keeps
    them: those that a vehicle writes itself are left out. None without a history, where it holds no such run, and for
    a robot that is not surely told from others of its kind."""
    from care_core.history.store import History, HistoryError, history_path
    from care_core.report.document import remembered_verdict
    from care_core.report.reading import remembered
    from care_core.run import Setting

    def is_ok(run: Triaged) -> bool:
        return remembered_verdict(remembered(run.document)).status == "ok"

    path = history_path()
    if path is None or not path.exists() or robot is None or not robot.is_sure:
        return None
    try:
        past = History(path).runs_of(robot.id)
        good = next((run for run in past if run.settings and _is_earlier(run, log) and is_ok(run)), None)
    except HistoryError:  # the triage goes on without, and says so when it writes to it
        return None
    return None if good is None else {name: Setting(name, value, "history") for name, value in good.settings.items()}


def _is_earlier(run: Triaged, log: LogInfo) -> bool:
    """Whether another run was made before a log, by their clocks where both have one."""
    told = run.document["log"]
    start = told.get("start")
    return told.get("sha256") != log.sha256 and (not start or not log.start or str(start) < log.start)

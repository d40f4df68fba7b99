"""The last good run of a robot that the history holds: what was changed since is evidence, as with `--since`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from care_core.history.store import Triaged
    from care_core.run import LogInfo, Robot, Run, Setting


def last_good(robot: Robot | None, run: Run) -> Mapping[str, Setting] | None:
    """The parameters of the last run of this very robot before a run in which nothing failed, as far as the history
    keeps them: those that a vehicle writes itself are left out. None without a history, where it holds no such run, and
    for a robot that is not surely told from others of its kind, as none is that a machine simulates."""
    from care_core.history.store import History, HistoryError, history_path
    from care_core.report.document import remembered_verdict
    from care_core.report.reading import remembered
    from care_core.run import Setting

    def is_ok(past: Triaged) -> bool:
        # What was judged by limits of its own, or against another run, may be good by those alone.
        return not past.judged_with and remembered_verdict(remembered(past.document)).status == "ok"

    path = history_path()
    if path is None or not path.exists() or robot is None or not robot.is_sure or robot.is_simulated:
        return None
    try:
        runs = (past for past in History(path).runs_of(robot.id) if past.settings and _is_earlier(past, run.log))
        good = next((past for past in runs if _may_be_same(past, run) and is_ok(past)), None)
    except HistoryError:  # the triage goes on without, and says so when it writes to it
        return None
    return None if good is None else {name: Setting(name, value, "history") for name, value in good.settings.items()}


def _is_earlier(past: Triaged, log: LogInfo) -> bool:
    """Whether another run was made before a log, by their clocks where both have one."""
    told = past.document["log"]
    start = told.get("start")
    return told.get("sha256") != log.sha256 and (not start or not log.start or str(start) < log.start)


def _may_be_same(past: Triaged, run: Run) -> bool:
    """Whether a run that has the robot's id is of the same vehicle with the same firmware: a board may have been moved
    to another frame, and an operator may give two robots one name."""
    from care_core.configs.same_vehicle import may_be_same_vehicle

    firmware = run.log.facts.get("firmware", "")
    settings = {name: setting.value for name, setting in run.settings.items()}
    is_same = not past.firmware or not firmware or past.firmware == firmware
    return is_same and may_be_same_vehicle({**past.settings, **past.individual}, settings)

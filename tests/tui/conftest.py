"""The app on a hand-made diagnosis: no log, no profile, no engine."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from textual.pilot import Pilot

from care_core.diagnose.records import Diagnosis, Fix
from care_core.run import Run
from care_tui.app import CareApp
from care_tui.jobs import Engine, Progress, ReportFormat, Request

LOG = Path("/flights/00000042.BIN")
MakeApp = Callable[..., CareApp]


def fake_diff(run: Run, fix: Fix) -> str:
    lines = ["--- as driven", "+++ suggested"]
    for change in fix.changes:
        lines += [f"-{change.option.name} {change.current:g}", f"+{change.option.name} {change.suggested:g}"]
    return "\n".join(lines)


def fake_report(diagnosis: Diagnosis, format: ReportFormat) -> str:
    assert diagnosis.fix is None or diagnosis.fix.changes
    changes = () if diagnosis.fix is None else diagnosis.fix.changes
    return "\n".join([f"report: {format}", *(f"  {change.option.name}: {change.suggested:g}" for change in changes)])


@pytest.fixture
def make_app() -> MakeApp:
    """An app that shows a given diagnosis, or raises a given error instead."""

    def make(outcome: Diagnosis | Exception, *, ascii: bool = False) -> CareApp:
        def diagnose(request: Request, progress: Progress) -> Diagnosis:
            progress("reading the log", 0.5)
            if isinstance(outcome, Exception):
                raise outcome
            return outcome

        return CareApp(Request(LOG), engine=Engine(diagnose, fake_diff, fake_report), ascii=ascii)

    return make


async def settle(pilot: Pilot[int], *keys: str) -> None:
    """Press keys one by one, each after the work of the one before is shown."""
    await pilot.app.workers.wait_for_complete()
    await pilot.pause()
    for key in keys:
        await pilot.press(key)
        await pilot.app.workers.wait_for_complete()
        await pilot.pause()

"""Putting what was triaged and verified into the local history. One that cannot be used never stops the work."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from care_core.errors import CareError

if TYPE_CHECKING:
    from care_core.diagnose.records import Diagnosis
    from care_core.history.store import About, History
    from care_core.run import Run


def remember(record: Callable[[History], None]) -> CareError | None:
    """Put something into the history, unless that is switched off; answers what was in the way."""
    from care_core.history.store import History, HistoryError, history_path

    path = history_path()
    if path is None:
        return None
    try:
        record(History(path))
    except HistoryError as err:
        return err
    return None


def remember_triage(diagnosis: Diagnosis) -> CareError | None:
    """Put a triage into the history; answers what was in the way."""
    from care_core.report.document import build_document
    from care_core.report.writers import published

    document, about = published(build_document(diagnosis)), about_run(diagnosis.run)
    return remember(lambda history: history.add_triage(document, diagnosis.run.mission.index, about))


def about_run(run: Run) -> About:
    """What the history keeps of a run beside its document."""
    from care_core.ecosystems.vehicles import is_self_written
    from care_core.history.store import About

    settings = {name: setting.value for name, setting in run.settings.items() if not is_self_written(name)}
    return About(run.log.robot, dict(run.mission.asked), run.log.facts.get("firmware", ""), settings, run.log.recording)

"""Putting what was triaged and verified into the local history. One that cannot be used never stops the work."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from typing import TYPE_CHECKING

from care_core.errors import CareError

if TYPE_CHECKING:
    from care_core.application.case import Request
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


def remember_triage(diagnosis: Diagnosis, request: Request | None = None) -> CareError | None:
    """Put a triage into the history, with what was asked of it; answers what was in the way."""
    from care_core.records import replace
    from care_core.report.document import build_document
    from care_core.report.writers import published

    document, about = published(build_document(diagnosis)), about_run(diagnosis.run)
    if request is not None:
        about = replace(about, terms=terms_of(request), judged_with=options_of(request))
    return remember(lambda history: history.add_triage(document, diagnosis.run.mission.index, about))


def terms_of(request: Request) -> str:
    """What a log is judged by where that is not the profile alone, as a digest: the operator's bounds, the site file
    as it is now, another reference. Empty where nothing is."""
    from care_core.files import read_small_bytes
    from care_core.profile.site import site_path

    try:
        site = read_small_bytes(request.site or site_path())
    except OSError:  # there is none, or reading it for the triage says what is wrong
        site = b""
    asked = (
        request.profile, request.configs, request.keep, sorted(request.thresholds.items()), request.mission,
        request.repeats, request.since, request.reference, site,
    )  # fmt: skip
    return hashlib.sha256(repr(asked).encode()).hexdigest()[:16] if any(asked) else ""


def options_of(request: Request) -> str:
    """The options that give a log other limits or another reference than its own, as they are typed: with them, its
    verdict is not the one that it has by itself. Empty where there are none."""
    files = (("--since", request.since), ("--reference", request.reference), ("--site", request.site))
    given = [f"{option} {file.name}" for option, file in files if file is not None]
    given += [f"--threshold {name}={bound:g}" for name, bound in request.thresholds.items()]
    return ", ".join(given)


def about_run(run: Run) -> About:
    """What the history keeps of a run beside its document."""
    from care_core.configs.same_vehicle import individual
    from care_core.ecosystems.vehicles import is_self_written
    from care_core.history.store import About

    every = {name: setting.value for name, setting in run.settings.items()}
    settings = {name: value for name, value in every.items() if not is_self_written(name)}
    return About(
        run.log.robot,
        dict(run.mission.asked),
        run.log.facts.get("firmware", ""),
        settings,
        run.log.recording,
        individual=individual(every),
    )

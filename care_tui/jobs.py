"""What runs in worker threads. The bodies call care_core and touch no widget."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from care_core.errors import CareError, ExitCode

if TYPE_CHECKING:
    from care_core.diagnose.records import Diagnosis, Fix, ProfileChoice
    from care_core.diagnose.whatif import Question
    from care_core.logs.base import Log
    from care_core.logs.digest import Sha256
    from care_core.profile.store import Profile
    from care_core.run import Run

Progress = Callable[[str, float], None]
ReportFormat = Literal["yaml", "markdown", "json"]

SUFFIXES: dict[str, ReportFormat] = {".yaml": "yaml", ".yml": "yaml", ".md": "markdown", ".json": "json"}
"""File suffix to report format; the first suffix of a format is its default."""


class CancelledError(Exception):
    """The operator took the work back. Raised out of a progress call to unwind the engine."""


@dataclass(frozen=True, slots=True)
class Request:
    """What an operator asks: a log, and how to look at it. The fields are the options of `care triage`."""

    log: Path
    profile: str | None = None
    configs: tuple[str | Path, ...] = ()
    """Files as the operator names them: FILE or NAMESPACE=FILE."""
    keep: tuple[str, ...] = ()
    thresholds: Mapping[str, float] = field(default_factory=dict)
    top: int = 5
    mission: int | None = None
    since: Path | None = None


def diagnose_log(request: Request, progress: Progress) -> Diagnosis:
    """The whole line from a log file to its diagnosis. Raises CareError."""
    from care_core.logs import sniff
    from care_core.logs.digest import hashing

    sniff(request.log)
    # Begun before anything else is imported: of a large log it takes as long as all the rest.
    with hashing(request.log) as sha256:
        return _diagnose(request, sha256, progress)


def _diagnose(request: Request, sha256: Sha256, progress: Progress) -> Diagnosis:
    from care_core.configs import read_configs
    from care_core.diagnose.triage import triage
    from care_core.logs import open_log

    configs = read_configs(request.configs)
    progress("opening the log", 0.0)
    log, chosen, choice = open_and_choose(request.log, request.profile)
    return triage(
        log,
        chosen,
        choice,
        configs=configs,
        keep=request.keep,
        thresholds=request.thresholds,
        mission=request.mission,
        since=None if request.since is None else open_log(request.since),
        top=request.top,
        progress=progress,
        sha256=sha256,
    )


def open_and_choose(path: Path, profile: str | None) -> tuple[Log, Profile, ProfileChoice]:
    """A log with the profile that fits it, or the one that was named. Raises CareError."""
    from care_core.logs import open_log
    from care_core.profile.select import choose_profile
    from care_core.profile.store import available_profiles, load_profile

    log = open_log(path)
    names: list[Path] | list[str] = available_profiles() if profile is None else [profile]
    return (log, *choose_profile(log, [load_profile(name) for name in names]))


def question_of(request: Request, progress: Progress) -> Question:
    """A run ready to be asked what other options would have done. Raises CareError."""
    from care_core.configs import read_configs
    from care_core.diagnose.whatif import question_of_log

    configs = read_configs(request.configs)
    progress("reading the log", 0.0)
    log, profile, choice = open_and_choose(request.log, request.profile)
    return question_of_log(
        log, profile, choice, configs=configs, thresholds=request.thresholds, mission=request.mission
    )


def diff_of(run: Run, fix: Fix) -> str:
    """The configuration as driven against the suggested one, as a unified diff."""
    from care_core.configs import unified_diff

    return unified_diff(run, fix)


def report_of(diagnosis: Diagnosis, format: ReportFormat) -> str:
    """The fix report in one of its formats."""
    from care_core.report import build_document, to_json, to_markdown, to_yaml

    write = {"yaml": to_yaml, "markdown": to_markdown, "json": to_json}[format]
    return write(build_document(diagnosis))


def save_report(path: Path, text: str) -> None:
    """Write the report; the file is whole or not there at all."""
    from care_core.report import write_atomically

    write_atomically(path, text)


@dataclass(frozen=True, slots=True)
class Engine:
    """Everything the app asks of care_core."""

    diagnose: Callable[[Request, Progress], Diagnosis] = diagnose_log
    diff: Callable[[Run, Fix], str] = diff_of
    report: Callable[[Diagnosis, ReportFormat], str] = report_of
    save: Callable[[Path, str], None] = save_report


def exit_code(diagnosis: Diagnosis) -> ExitCode:
    """What the diagnosis means for the process that asked for it."""
    statuses = {objective.status for objective in diagnosis.objectives}
    if "fault" in statuses:
        return ExitCode.FAULT
    return ExitCode.NOT_EVALUATED if "not_evaluated" in statuses or not statuses else ExitCode.OK


def fixes(diagnosis: Diagnosis) -> tuple[Fix, ...]:
    """Every fix the operator can choose from, the suggested one first."""
    return () if diagnosis.fix is None else (diagnosis.fix, *diagnosis.alternatives)


def with_fix(diagnosis: Diagnosis, index: int) -> Diagnosis:
    """The diagnosis with another of its fixes as the suggested one."""
    chosen = fixes(diagnosis)[index]
    others = tuple(fix for fix in fixes(diagnosis) if fix is not chosen)
    return replace(diagnosis, fix=chosen, alternatives=others)


def as_care_error(err: Exception) -> CareError:
    """Any error as one that can be shown: message, hint, where."""
    if isinstance(err, CareError):
        return err
    logging.getLogger(__name__).error("unexpected error", exc_info=err)
    return CareError(
        f"Unexpected error: {type(err).__name__}: {err}",
        hint="This is a defect of care, not of your robot: please report it with the log.",
    )

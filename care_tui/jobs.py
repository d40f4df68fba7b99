"""What runs in worker threads. The bodies call care_core and touch no widget."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from care_core.diagnose.records import Diagnosis, Fix
from care_core.errors import CareError, ExitCode
from care_core.run import Run

Progress = Callable[[str, float], None]
ReportFormat = Literal["yaml", "markdown", "json"]

SUFFIXES: dict[str, ReportFormat] = {".yaml": "yaml", ".yml": "yaml", ".md": "markdown", ".json": "json"}
"""File suffix to report format; the first suffix of a format is its default."""


class CancelledError(Exception):
    """The operator took the work back. Raised out of a progress call to unwind the engine."""


def diagnose_log(path: Path, profile: str | None, configs: Sequence[Path], progress: Progress) -> Diagnosis:
    """The whole line from a log file to its diagnosis, the same as `care triage` runs."""
    from care_core.configs import read_configs
    from care_core.diagnose.triage import triage
    from care_core.logs import open_log
    from care_core.profile.select import choose_profile
    from care_core.profile.store import available_profiles, load_profile

    overrides = read_configs(configs)
    progress("opening the log", 0.0)
    log = open_log(path)
    names: list[Path] | list[str] = available_profiles() if profile is None else [profile]
    chosen, choice = choose_profile(log, [load_profile(name) for name in names])
    return triage(log, chosen, choice, configs=overrides, progress=progress)


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

    diagnose: Callable[[Path, str | None, Sequence[Path], Progress], Diagnosis] = diagnose_log
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

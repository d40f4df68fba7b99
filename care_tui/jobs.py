"""What runs in worker threads. The bodies call care_core and touch no widget."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeVar

from care_core.errors import CareError, ExitCode

if TYPE_CHECKING:
    from care_core.diagnose.records import Diagnosis, Fix
    from care_core.profile.model import Model
    from care_core.profile.schema import Schema
    from care_core.variables import Variable

T = TypeVar("T")
Progress = Callable[[str, float], None]
ReportFormat = Literal["yaml", "markdown", "html", "json", "patch"]
DiffSide = Literal["driven", "file", "changed"]

SUFFIXES: dict[str, ReportFormat] = {
    ".yaml": "yaml",
    ".yml": "yaml",
    ".md": "markdown",
    ".html": "html",
    ".htm": "html",
    ".json": "json",
    ".patch": "patch",
    ".diff": "patch",
}
"""File suffix to report format; the first suffix of a format is its default."""


class CancelledError(BaseException):
    """The operator took the work back. Not an Exception: no reader may mistake it for damage and go on."""


class Job:
    """Work in a thread of its own that nobody waits for: not the operator who stops it, nor the end of the program.

    A thread cannot be stopped from outside without leaving locks behind (that of an import, for one), so one that is
    cancelled ends at its next `check`; whatever it answers is dropped.
    """

    def __init__(self) -> None:
        self.cancelled = False
        self.done = False

    def start(self, work: Callable[[Job], T], receive: Callable[[T | CareError], None]) -> None:
        """Run `work`; its answer, or its error, goes to `receive`, in that thread."""
        threading.Thread(target=self._run, args=(work, receive), daemon=True).start()

    def _run(self, work: Callable[[Job], T], receive: Callable[[T | CareError], None]) -> None:
        try:
            answer: T | CareError = work(self)
        except CancelledError:
            return
        except Exception as err:
            answer = as_care_error(err)
        if not self.cancelled:
            receive(answer)

    def check(self) -> None:
        """Raise CancelledError when the work is not wanted any more."""
        if self.cancelled:
            raise CancelledError


CAUSES = 10
"""Most causes per fault in the app: more than a report shows, for here they scroll."""


@dataclass(frozen=True, slots=True)
class Request:
    """What an operator asks: a log, and how to look at it. The fields are the options of `care triage`."""

    log: Path
    profile: str | None = None
    configs: tuple[Path, ...] = ()
    keep: tuple[str, ...] = ()
    thresholds: Mapping[str, float] = field(default_factory=dict)
    top: int = 5
    mission: int | None = None


@dataclass(frozen=True, eq=False)
class Case:
    """A diagnosis with what is needed to ask more about it."""

    diagnosis: Diagnosis
    options: tuple[Variable, ...] = ()
    """Every option of the profile, in its order."""
    schema: Schema | None = None
    model: Model | None = None
    configs: tuple[Path, ...] = ()
    """Configuration files that the operator named."""


def open_case(request: Request, progress: Progress) -> Case:
    """The whole line from a log file to its diagnosis. Raises CareError."""
    from care_core.configs import read_configs
    from care_core.diagnose.triage import triage
    from care_core.logs import open_log
    from care_core.profile.select import choose_profile
    from care_core.profile.store import available_profiles, load_profile

    configs = read_configs(request.configs)
    progress("opening the log", 0.0)
    log = open_log(request.log)
    names: list[Path] | list[str] = available_profiles() if request.profile is None else [request.profile]
    chosen, choice = choose_profile(log, [load_profile(name) for name in names])
    diagnosis = triage(
        log,
        chosen,
        choice,
        configs=configs,
        keep=request.keep,
        thresholds=request.thresholds,
        mission=request.mission,
        top=request.top,
        progress=progress,
    )
    return Case(diagnosis, chosen.schema.options, chosen.schema, chosen.model, request.configs)


def diagnose_log(request: Request, progress: Progress) -> Diagnosis:
    """The answer alone, as `care triage` prints it. Raises CareError."""
    return open_case(request, progress).diagnosis


def predict(case: Case, changes: Mapping[str, float]) -> Fix:
    """What these changes are predicted to bring; without any, what the same configuration would bring again."""
    from care_core.causal.counterfactual import World
    from care_core.diagnose.fixes import to_fix
    from care_core.diagnose.ranking import reference_config
    from care_core.run import is_known

    if case.model is None or case.schema is None:
        raise CareError("There is no model to ask.", hint="Open a log that a profile with a model fits.")
    run = case.diagnosis.run
    met = {name: value for name, value in run.context.items() if is_known(value)}
    config = {**reference_config(case.schema, case.model), **met, **run.config}
    bounds = {r.variable.name: r.threshold for r in case.diagnosis.objectives if r.threshold is not None}
    world = World(case.model, config, {**run.metrics, **run.objectives}, bounds)
    odds = float(world.odds([{**config, **changes}])[0])
    return to_fix(world, case.schema.variables, changes, odds)


def diff_of(case: Case, fix: Fix, side: DiffSide) -> str:
    """Two of these as a unified diff: the configuration as driven, the operator's file, the suggested one."""
    from care_core.configs import unified_diff

    return unified_diff(case.diagnosis.run, fix)


def report_of(diagnosis: Diagnosis, format: ReportFormat) -> str:
    """The fix report in one of its formats."""
    from care_core.report import build_document, to_html, to_json, to_markdown, to_yaml

    document = build_document(diagnosis)
    if format == "patch":
        return document.diff
    write = {"yaml": to_yaml, "markdown": to_markdown, "html": to_html, "json": to_json}[format]
    return write(document)


def commands_of(diagnosis: Diagnosis) -> list[str]:
    """The shell or ground station commands that make the changes of the fix."""
    from care_core.configs import apply_commands, format_for

    if diagnosis.fix is None:
        return []
    return apply_commands(diagnosis.fix.changes, format_for(diagnosis.run.log.format))


def save_text(path: Path, text: str) -> None:
    """Write a file; it is whole or not there at all."""
    from care_core.report import write_atomically

    write_atomically(path, text)


@dataclass(frozen=True, slots=True)
class Engine:
    """Everything the walk asks of care_core."""

    diagnose: Callable[[Request, Progress], Case] = open_case
    predict: Callable[[Case, Mapping[str, float]], Fix] = predict
    diff: Callable[[Case, Fix, DiffSide], str] = diff_of
    report: Callable[[Diagnosis, ReportFormat], str] = report_of
    commands: Callable[[Diagnosis], list[str]] = commands_of
    save: Callable[[Path, str], None] = save_text


def exit_code(diagnosis: Diagnosis) -> ExitCode:
    """What the diagnosis means for the process that asked for it."""
    statuses = {objective.status for objective in diagnosis.objectives}
    if "fault" in statuses:
        return ExitCode.FAULT
    return ExitCode.NOT_EVALUATED if "not_evaluated" in statuses or not statuses else ExitCode.OK


def fixes(diagnosis: Diagnosis) -> tuple[Fix, ...]:
    """Every fix that the engine found, the suggested one first."""
    return () if diagnosis.fix is None else (diagnosis.fix, *diagnosis.alternatives)


def decided(diagnosis: Diagnosis, fix: Fix | None, dismissed: Mapping[str, str]) -> Diagnosis:
    """The diagnosis with what the operator made of it: the changes that are ticked, and the causes set aside."""
    from care_core.diagnose.records import Dismissal

    aside = tuple(Dismissal(option, reason) for option, reason in dismissed.items())
    if fix is None or not fix.changes:
        return replace(diagnosis, fix=None, alternatives=fixes(diagnosis), dismissed=aside)
    wanted = changes_of(fix)
    others = tuple(other for other in fixes(diagnosis) if changes_of(other) != wanted)
    return replace(diagnosis, fix=fix, alternatives=others, dismissed=aside)


def changes_of(fix: Fix) -> dict[str, float]:
    """The fix as option to value."""
    return {change.option.name: change.suggested for change in fix.changes}


def as_care_error(err: Exception) -> CareError:
    """Any error as one that can be shown: message, hint, where."""
    if isinstance(err, CareError):
        return err
    logging.getLogger(__name__).error("unexpected error", exc_info=err)
    return CareError(
        f"Unexpected error: {type(err).__name__}: {err}",
        hint="This is a defect of care, not of your robot: please report it with the log.",
    )

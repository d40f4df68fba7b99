"""What runs in worker threads. The bodies call care_core and touch no widget."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeVar

from care_core.errors import CareError, ExitCode
from care_tui.remembering import remember_triage

if TYPE_CHECKING:
    from care_core.causal.model import Model
    from care_core.diagnose.records import Diagnosis, Fix
    from care_core.diagnose.whatif import Question
    from care_core.logs.base import Log
    from care_core.logs.digest import Sha256
    from care_core.profile.schema import Schema
    from care_core.profile.store import Profile
    from care_core.run import ProfileChoice
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


@dataclass(frozen=True, eq=False)
class Case:
    """A diagnosis with what is needed to ask more about it."""

    diagnosis: Diagnosis
    options: tuple[Variable, ...] = ()
    """Every option of the profile, in its order."""
    schema: Schema | None = None
    model: Model | None = None
    question: Question | None = None
    """The run ready to be asked what other options would have done."""
    configs: tuple[str | Path, ...] = ()
    """Configuration files that the operator named."""


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
    """The answer alone, as `care triage` prints it. Raises CareError."""
    return _answer(request, progress)[0]


def open_case(request: Request, progress: Progress) -> Case:
    """The answer with all that is needed to ask more about it. Raises CareError."""
    from care_core.diagnose.whatif import question

    diagnosis, profile, choice = _answer(request, progress)
    asked = question(diagnosis.run, profile, choice, request.thresholds)
    schema = profile.schema
    return Case(diagnosis, schema.options, schema, profile.model, asked, request.configs)


def _answer(request: Request, progress: Progress) -> tuple[Diagnosis, Profile, ProfileChoice]:
    """The whole line from a log file to its diagnosis."""
    from care_core.logs.digest import hashing
    from care_core.logs.opening import sniff

    sniff(request.log)
    # Begun before anything else is imported: of a large log it takes as long as all the rest.
    with hashing(request.log) as sha256:
        return _diagnose(request, sha256, progress)


def _diagnose(request: Request, sha256: Sha256, progress: Progress) -> tuple[Diagnosis, Profile, ProfileChoice]:
    from care_core.configs.loading import read_configs
    from care_core.diagnose.triage import triage
    from care_core.logs.opening import open_log

    configs = read_configs(request.configs)
    progress("opening the log", 0.0)
    log, chosen, choice = open_and_choose(request.log, request.profile)
    diagnosis = triage(
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
    return diagnosis, chosen, choice


def open_and_choose(path: Path, profile: str | None) -> tuple[Log, Profile, ProfileChoice]:
    """A log with the profile that fits it, or the one that was named. Raises CareError."""
    from care_core.extract.select import fitting_profile
    from care_core.logs.opening import open_log
    from care_core.profile.store import available_profiles, load_profile

    log = open_log(path)
    names: list[Path] | list[str] = available_profiles() if profile is None else [profile]
    return (log, *fitting_profile(log, [load_profile(name) for name in names]))


def question_of(request: Request, progress: Progress) -> Question:
    """A run ready to be asked what other options would have done. Raises CareError."""
    from care_core.configs.loading import read_configs
    from care_core.diagnose.whatif import question_of_log

    configs = read_configs(request.configs)
    progress("reading the log", 0.0)
    log, profile, choice = open_and_choose(request.log, request.profile)
    return question_of_log(
        log, profile, choice, configs=configs, thresholds=request.thresholds, mission=request.mission
    )


def predict(case: Case, changes: Mapping[str, float]) -> Fix:
    """What these changes are predicted to bring; without any, what the same configuration would bring again."""
    from care_core.diagnose.records import Fix

    if case.question is None:
        raise CareError("There is no model to ask.", hint="Open a log that a profile with a model fits.")
    answer = case.question.ask(changes)
    predicted = {outlook.objective.variable.name: outlook.predicted for outlook in answer.outlooks}
    return Fix(answer.changes, answer.p_ok, predicted)


def diff_of(case: Case, fix: Fix, side: DiffSide) -> str:
    """A unified diff: what was driven, or the operator's files, against the suggestion; or one against the other."""
    from care_core.configs.changes import unified_diff

    if side == "driven":
        return unified_diff(case.diagnosis.run, fix.changes)
    if side == "file":
        return _patch_of(case, fix)
    return _file_against_driven(case)


def _patch_of(case: Case, fix: Fix) -> str:
    """The operator's files with the fix put in, comments and order kept."""
    from difflib import unified_diff

    from care_core.configs.driven import parameter_value, readable
    from care_core.configs.edit import Wanted, apply_changes

    wanted = [
        Wanted(change.option, parameter, parameter_value(change.option, change.suggested))
        for change in fix.changes
        for parameter in readable(change.option)
    ]
    lines: list[str] = []
    for file in apply_changes([str(name) for name in case.configs], wanted):
        before, after = file.before.splitlines(), file.after.splitlines()
        lines += unified_diff(before, after, f"a/{file.path}", f"b/{file.path}", lineterm="")
    return "".join(f"{line}\n" for line in lines)


def _file_against_driven(case: Case) -> str:
    """What the files hold otherwise than the robot drove."""
    from care_core.configs.compare import Side, compare
    from care_core.configs.loading import read_configs, resolve

    settings = case.diagnosis.run.settings
    held = resolve(read_configs(case.configs), settings)
    found = compare(Side("as driven", {name: settings[name] for name in held if name in settings}), Side("file", held))
    lines = [str(difference) for difference in found]
    return "".join(f"{line}\n" for line in lines)


def report_of(diagnosis: Diagnosis, format: ReportFormat) -> str:
    """The fix report in one of its formats."""
    from care_core.report.document import build_document
    from care_core.report.html import to_html
    from care_core.report.writers import to_json, to_markdown, to_yaml

    document = build_document(diagnosis)
    if format == "patch":
        return document.diff
    write = {"yaml": to_yaml, "markdown": to_markdown, "html": to_html, "json": to_json}[format]
    return write(document)


def commands_of(diagnosis: Diagnosis) -> list[str]:
    """The shell or ground station commands that make the changes of the fix."""
    from care_core.configs.changes import apply_commands
    from care_core.configs.formats import format_for

    if diagnosis.fix is None:
        return []
    return apply_commands(diagnosis.fix.changes, format_for(diagnosis.run.log.format, diagnosis.run.settings))


def save_text(path: Path, text: str) -> None:
    """Write a file; it is whole or not there at all."""
    from care_core.files import write_atomically

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
    remember: Callable[[Diagnosis], CareError | None] = remember_triage


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

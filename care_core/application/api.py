"""The functions that scripts and notebooks call, and the commands with them; `care_core` hands them on by name."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from care_core.application.case import Case, Request, choose, fitting, open_case, read_case
from care_core.errors import CareError, LogError, ProfileError, UsageError
from care_core.progress import Progress, silent
from care_core.records import replace

if TYPE_CHECKING:
    from care_core.application.comparing import Compared
    from care_core.configs.edit import EditedFile
    from care_core.diagnose.whatif import Answer
    from care_core.logs.base import Log
    from care_core.report.document import TriageDocument
    from care_core.report.inspection import InspectDocument
    from care_core.report.verification import VerifyDocument


def open_log(path: str | Path) -> Log:
    """A log by what it holds, not by what it is called. Raises LogError."""
    from care_core.logs import opening

    return opening.open_log(path)


def inspect(log: str | Path) -> InspectDocument:
    """What happened in a log, what it holds, and what each installed profile finds in it; nothing is judged.

    Raises:
        LogError: the log cannot be read.
    """
    from care_core.ecosystems.examine import examine
    from care_core.ecosystems.registry import run_model
    from care_core.extract.coverage import try_on
    from care_core.extract.select import sound_profiles
    from care_core.report.inspection import build_inspection
    from care_core.run import Fit, ProfileChoice

    found = open_log(log)
    trials = [try_on(found, profile.schema) for profile in sound_profiles()[0]]
    try:
        choice = choose(found)[1]
    except LogError as err:  # not a message is left of it, which is worth a look too
        choice = ProfileChoice("", "", "", "", Fit("no", (err.message.rstrip("."),)))
    return build_inspection(found, trials, choice, examine(run_model(found)))


def triage(asked: Request | str | Path, progress: Progress = silent) -> Case:
    """Diagnose a run: the last mission of a log, or as the request says. Raises CareError."""
    return open_case(_request(asked), progress)


def what_if(asked: Case | Request | str | Path, changes: Mapping[str, float]) -> Answer:
    """What a run would have done with these options changed, named as in the profile or in the log.

    Raises:
        CareError: the log cannot be read, no profile fits it, or the profile has no such option.
    """
    from care_core.diagnose.whatif import option_named

    for name, value in changes.items():
        if not isinstance(value, (int, float)):
            hint = f"Pass changes={{'{name}': 40}}."
            raise UsageError(f"The value of '{name}' is {value!r}, not a number.", hint=hint, where="changes")
    reading = asked.reading if isinstance(asked, Case) else read_case(_request(asked), silent)
    if reading is None:
        raise CareError("There is no model to ask.", hint="Open a log that a profile with a model fits.")
    schema = reading.profile.schema
    return reading.question.ask({option_named(name, schema).name: value for name, value in changes.items()})


def compare(a: Request | str | Path, b: Request | str | Path, progress: Progress = silent) -> Compared:
    """Two runs side by side, A the one to compare with: `compare(good, failed).report()`. Raises CareError."""
    from care_core.application.comparing import compare as put_beside

    return put_beside(_request(a), _request(b), progress)


def verify(
    report: TriageDocument | str | Path,
    log: Request | str | Path,
    profile: str | None = None,
    mission: int | None = None,
    reference: str | Path | None = None,
) -> VerifyDocument:
    """What became of a report's promise in the run of a later log, which is triaged for that.

    Args:
        report: its file, or the document itself.
        log: also the whole request, which then says what the others would.
        profile: another than that of the report, by name or folder.
        reference: the configuration that the run is judged against, as in the triage that wrote the report.

    Raises:
        CareError: the report is none, suggests no change or one of no parameter of its profile, no such profile is
            installed, or the log cannot be read.
    """
    from care_core.application.verifying import held_against
    from care_core.profile.store import load_profile
    from care_core.report.reading import read_report
    from care_core.report.suggested import report_profile
    from care_core.report.verification import promise_of

    if isinstance(report, (str, Path)):
        promised, path = read_report(report), Path(report)
    else:
        promised, path = report, Path(report.log.path)
    good = None if reference is None else Path(reference)
    asked = log if isinstance(log, Request) else Request(Path(log), profile, mission=mission, reference=good)
    chosen = load_profile(asked.profile) if asked.profile else report_profile(promised, path)
    promise_of(promised, chosen.schema, path)  # a report that promises nothing is refused before a log is read
    case = open_case(replace(asked, profile=str(chosen.path)), silent)
    if case.reading is None and case.log is not None:
        try:  # a run without a mission is compared, one of another robot is not
            fitting(case.log, str(chosen.path))
        except ProfileError as err:
            if asked.profile:
                raise
            hint = f"The report is of profile '{chosen.schema.name}': give a later log of the robot that it is of."
            raise ProfileError(err.message, hint=hint, where=err.where) from err
    return held_against(promised, path, case, asked.thresholds, chosen)


def apply(
    report: str | Path, *configs: str | Path, alternative: int = 0, profile: str | None = None
) -> tuple[EditedFile, ...]:
    """Configuration files with a report's fix put in; comments and order stay, and nothing is written.

    Args:
        configs: files in the order they are loaded, `FILE` or for ROS `NAMESPACE=FILE`.
        alternative: another of the report's fixes, from 1.
        profile: the report's, where it is not installed under its name.

    Raises:
        CareError: the report suggests no change, or no file can hold it.
    """
    from care_core.application.configuring import apply_report

    return apply_report(Path(report), [str(name) for name in configs], alternative, profile)


def _request(asked: Request | str | Path) -> Request:
    return asked if isinstance(asked, Request) else Request(Path(asked))

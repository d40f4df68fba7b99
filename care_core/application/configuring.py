"""The configuration in whatever was named, and fixes put into configuration files. Nothing is written here."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from care_core.errors import ConfigError, UsageError
from care_core.files import open_regular
from care_core.run import Setting
from care_core.text import clean, number_of

if TYPE_CHECKING:
    from care_core.application.case import Case
    from care_core.configs.compare import Side
    from care_core.configs.edit import EditedFile, Wanted
    from care_core.diagnose.records import Diagnosis, Fix
    from care_core.report.document import TriageDocument

DiffSide = Literal["driven", "file", "changed"]

_HEAD_BYTES = 4096
_WHOLE = 100
"""Parameters from which a file is one of a whole vehicle."""


def side_of(name: str) -> Side:
    """The configuration in whatever was named, told by its content: a file, a log or a report. Raises CareError."""
    from care_core.configs.compare import Side
    from care_core.configs.loading import read_configs, split_name
    from care_core.logs.opening import is_recording, open_log
    from care_core.report.reading import read_report

    path, _ = split_name(name)
    head = b"" if path.is_dir() else _head(path)
    if path.is_dir() or b"\0" in head or is_recording(path):
        histories = open_log(path).settings()
        if not histories:
            raise ConfigError("The log holds no parameters.", hint="Compare a configuration file.", where=str(path))
        return Side(str(path), {name: history[-1] for name, history in histories.items()})
    if b"care.triage/" in head:
        return _suggested(read_report(path), path)
    (file,) = read_configs([name])
    return Side(name, file.settings, file.format)


def _head(path: Path) -> bytes:
    """The first bytes of a file. Raises ConfigError for what is none, or empty."""
    try:
        with open_regular(path) as stream:
            head = stream.read(_HEAD_BYTES)
    except OSError as err:
        hint = "Check the path."
        raise ConfigError(f"Cannot read the file: {err.strerror}.", hint=hint, where=str(path)) from err
    if not head:
        raise ConfigError("The file is empty.", hint="Was it copied whole?", where=str(path))
    return head


def _suggested(report: TriageDocument, path: Path) -> Side:
    """The configuration that a report suggests: what was driven, with its fix."""
    from care_core.configs.compare import Side
    from care_core.configs.driven import readable
    from care_core.report.suggested import report_profile, suggested_changes

    config = {name: float(value) for name, value in report.config.items()}
    schema = report_profile(report, path).schema
    if report.fix is not None:
        config |= {one.option.name: one.value for one in suggested_changes(report.fix, schema, path, "fix")}
    options = [option for option in schema.options if option.name in config]
    keys = {parameter: config[option.name] for option in options for parameter in readable(option)}
    return Side(str(path), {key: Setting(key, value, str(path)) for key, value in keys.items()}, partial=True)


def apply_report(
    report: Path, configs: Sequence[str], alternative: int = 0, profile: str | None = None
) -> tuple[EditedFile, ...]:
    """Configuration files with a report's fix put in, or with one of its alternatives.

    A report may be a stranger's: it sets the parameters of the profile's options alone, each to a value that the
    profile accepts, and a `safety` one no looser than its file and its default.

    Args:
        configs: files in the order they are loaded, `FILE` or for ROS `NAMESPACE=FILE`.
        profile: name or folder; the one that the report names where it is None.

    Raises:
        CareError: the report suggests no change, one that the profile does not allow, or is damaged; no such profile is
            installed; or no file can hold the change.
    """
    from care_core.configs.edit import apply_changes

    wanted = _wanted(report, alternative, profile)
    _check_safety(report, configs, wanted)
    return apply_changes(configs, wanted)


def override_of(report: Path, configs: Sequence[str], alternative: int = 0, profile: str | None = None) -> str:
    """A report's fix as a file of its own, to be loaded after the others: for one that several nodes load.

    Args and Raises as `apply_report`; `configs` say the format, and the values in force so far.
    """
    from care_core.configs.edit import check_held
    from care_core.configs.formats import text_for, write_params
    from care_core.configs.loading import read_configs
    from care_core.ecosystems.ros.yaml_tree import typed

    format = read_configs(configs)[0].format
    wanted = _wanted(report, alternative, profile)
    _check_safety(report, configs, wanted)
    texts = {one.parameter: text_for(format, one.option, one.value) for one in wanted}
    text = write_params({name: Setting(name, typed(text), str(report)) for name, text in texts.items()}, format)
    check_held(text, format, wanted)
    return text


def _wanted(report: Path, alternative: int, profile: str | None) -> list[Wanted]:
    from care_core.configs.driven import parameter_value
    from care_core.configs.edit import Wanted
    from care_core.profile.store import load_profile
    from care_core.report.reading import read_report
    from care_core.report.suggested import check_acceptable, fix_sets, report_profile, suggested_changes

    document = read_report(report)
    if document.fix is None:
        raise UsageError("The report suggests no change.", where=str(report))
    sets = list(fix_sets(document.fix))
    if alternative >= len(sets):
        held = "none" if len(sets) == 1 else f"1 to {len(sets) - 1}"
        raise UsageError(f"There is no alternative {alternative}: the report has {held}.", where="--alternative")
    schema = (load_profile(profile) if profile else report_profile(document, report)).schema
    key, chosen = sets[alternative]
    wanted = []
    for change in suggested_changes(chosen, schema, report, key):
        check_acceptable(change, report)
        option = change.option
        driven = None if change.is_assumed else parameter_value(option, change.before)
        value = parameter_value(option, change.value)
        wanted += [Wanted(option, parameter, value, driven) for parameter in option.parameters]
    return wanted


def _check_safety(report: Path, configs: Sequence[str], wanted: Sequence[Wanted]) -> None:
    """Refuse to loosen a `safety` option: the files say what it is now, not the report. Raises ConfigError."""
    from care_core.configs.driven import option_value
    from care_core.configs.loading import read_configs, resolve

    guarded = [one for one in wanted if one.option.safety and one.option.default is not None]
    if not guarded:
        return
    settings = resolve(read_configs(configs), [one.parameter for one in guarded])
    for one in guarded:
        option, setting = one.option, settings.get(one.parameter)
        value = option_value(option, Setting(one.parameter, one.value, str(report)))
        now = None if setting is None else option_value(option, setting)
        if value is None or not option.is_no_looser(value, now):
            held = "no file holds it" if now is None else f"the file has {option.show(now)}"
            raise ConfigError(
                f"{option.name} is a safety parameter, which is moved towards its default of "
                f"{option.show(option.default)} and never past it: {held}, the report wants {option.show(value)}.",
                hint="Set it by hand if you are sure.",
                where=str(report),
            )


def patch_of(files: Iterable[EditedFile]) -> str:
    """What was changed in files, as a patch."""
    lines: list[str] = []
    for file in files:
        before, after, name = file.before.splitlines(), file.after.splitlines(), str(file.path).lstrip("/")
        lines += difflib.unified_diff(before, after, f"a/{name}", f"b/{name}", lineterm="")
    return "".join(f"{clean(line)}\n" for line in lines)


def diff_of(case: Case, fix: Fix, side: DiffSide) -> str:
    """A unified diff: what was driven, or the operator's files, against the suggestion; or one against the other."""
    from care_core.configs.changes import unified_diff

    if side == "driven":
        return unified_diff(case.diagnosis.run, fix.changes, by_hand=fix.by_hand)
    if side == "file":
        return patch_of(edited_by(case, fix))
    return _file_against_driven(case)


def edited_by(case: Case, fix: Fix) -> tuple[EditedFile, ...]:
    """The operator's files with a fix put in; nothing is written. Raises ConfigError."""
    from care_core.configs.driven import parameter_value, readable
    from care_core.configs.edit import Wanted, apply_changes

    wanted = [
        Wanted(
            change.option,
            parameter,
            parameter_value(change.option, change.suggested),
            None if change.is_assumed else parameter_value(change.option, change.current),
        )
        for change in fix.changes
        for parameter in readable(change.option)
    ]
    return apply_changes([str(name) for name in case.configs], wanted)


def doubts_of(case: Case, fix: Fix) -> tuple[str, ...]:
    """Why the operator's files may be those of another robot, and what else is to be known before the fix is put into
    them. Raises ConfigError."""
    notes = [
        f"{', '.join(edit.parameters)}: {note}"
        for file in edited_by(case, fix)
        for edit in file.edits
        for note in edit.notes
    ]
    others = len(_file_against_driven(case).splitlines())
    if others:
        notes.append(
            f"{number_of(others, 'parameter')} of the file {'is' if others == 1 else 'are'} not what the robot ran"
        )
    return tuple(dict.fromkeys((*_of_other_vehicles(case), *notes)))


def _of_other_vehicles(case: Case) -> Iterator[str]:
    """Files that by their parameters, or by what was calibrated, are those of another vehicle than the log's."""
    from care_core.configs.loading import read_configs
    from care_core.configs.same_vehicle import may_be_same_vehicle
    from care_core.logs.formats import format_named

    run = case.diagnosis.run
    if format_named(run.log.format).ecosystem == "ros":
        return  # a file of ROS may hold any part of a robot
    driven = {name: setting.value for name, setting in run.settings.items()}
    for file in read_configs(case.configs):
        held = {name: setting.value for name, setting in file.settings.items()}
        known = sum(name in driven for name in held)
        if len(held) >= _WHOLE and known < len(held) / 2:
            yield f"{file.path}: the log has {known} of its {len(held)} parameters: it is another vehicle's file"
        elif not may_be_same_vehicle(held, driven):
            yield f"{file.path}: by its sensors, calibration or settings it is another vehicle's file"


def apply_to_files(case: Case, fix: Fix) -> list[tuple[Path, Path]]:
    """Put a fix into the operator's files: comments stay, and each old file is kept beside. Answers the files with
    where the old ones are. Raises ConfigError."""
    from care_core.configs.writing import replace_with_backup

    changed = [file for file in edited_by(case, fix) if file.after != file.before]
    return [(file.path, replace_with_backup(file)) for file in changed]


def _file_against_driven(case: Case) -> str:
    """What the files hold otherwise than the robot drove."""
    from care_core.configs.compare import Side, compare
    from care_core.configs.loading import read_configs, resolve

    settings = case.diagnosis.run.settings
    held = resolve(read_configs(case.configs), settings)
    found = compare(Side("as driven", {name: settings[name] for name in held if name in settings}), Side("file", held))
    return "".join(f"{clean(str(difference))}\n" for difference in found)


def commands_of(diagnosis: Diagnosis) -> list[str]:
    """The shell or ground station commands that make the changes of the fix."""
    from care_core.configs.changes import apply_commands
    from care_core.configs.formats import format_for

    if diagnosis.fix is None:
        return []
    return apply_commands(diagnosis.fix.changes, format_for(diagnosis.run.log.format, diagnosis.run.settings))

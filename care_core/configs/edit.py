"""Changes put into configuration files: only the value on the line concerned is touched.

Comments, order, spacing and line ends stay, since nothing is parsed and written again: the reader says on which line a
parameter is, and the value there is replaced. The edited text is then read once more, whatever the number of changes,
so a line that cannot be edited safely is refused, never damaged.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path

from care_core.configs.driven import as_number, same_value
from care_core.configs.formats import text_for
from care_core.configs.loading import ConfigFile, guesses, read_configs, read_text, resolve, split_name
from care_core.ecosystems.dialect import Dialect
from care_core.ecosystems.px4.dialect import QGC_PARAMS
from care_core.errors import ConfigError
from care_core.files import read_small_text
from care_core.records import Record, Struct, field
from care_core.run import Setting, shown
from care_core.variables import Variable

_ROUNDED = 1e-3
_APART = "One file is loaded for both: put one of them into a file of its own, loaded after it."


class Wanted(Record):
    """A parameter to set, by the name that the log has for it."""

    option: Variable
    parameter: str
    value: float
    driven: float | None = None
    """What was driven, where a log holds it."""


class Edit(Struct, eq=False):
    """What was done to one setting of a file, None for parameters that no file held."""

    where: str
    """file:line"""
    parameters: list[str]
    setting: Setting | None
    after: str
    notes: list[str]
    shared: set[str] = field(default_factory=set)
    """What else has its value from there, since the file is loaded more than once, and nobody wanted to change."""

    @property
    def before(self) -> float | str | None:
        """The value that the file had, None where it had none."""
        return None if self.setting is None else self.setting.value


class EditedFile(Struct, eq=False):
    """A file with its text before and after."""

    path: Path
    loads: tuple[ConfigFile, ...]
    """What it holds, once for each namespace that it is loaded into."""
    before: str
    after: str
    edits: list[Edit] = field(default_factory=list)

    @property
    def format(self) -> Dialect:
        """How the file is written."""
        return self.loads[0].format

    def holds(self, setting: Setting) -> bool:
        """Whether a setting is of this file."""
        return any(load.settings.get(setting.name) is setting for load in self.loads)


def apply_changes(names: Sequence[str], wanted: Sequence[Wanted]) -> tuple[EditedFile, ...]:
    """The files' new texts; nothing is written.

    Args:
        names: files in the order they are loaded, `FILE` or for ROS `NAMESPACE=FILE`.
        wanted: the parameters to set. One that no file holds is added to a file of vehicle parameters, whose names are
            unique; in YAML it is refused.

    Raises:
        ConfigError: a file cannot be read, or a parameter cannot be set in any of them.
    """
    loads = read_configs(names)
    files = _opened(loads, [split_name(name)[0] for name in names])
    settings = resolve(loads, [change.parameter for change in wanted])
    unsure = {parameter for named in guesses(loads, settings).values() for parameter in named}
    for change in wanted:
        setting = settings.get(change.parameter)
        if setting is None:
            _add(files, change)
        else:
            _set(
                next(file for file in files if file.holds(setting)), setting, change, unsure=change.parameter in unsure
            )
    for file in files:
        _check(file)
    return files


def _opened(loads: Sequence[ConfigFile], paths: Sequence[Path]) -> tuple[EditedFile, ...]:
    """Each file once, however often it is loaded, in the order in which it is named first."""
    loaded: dict[Path, list[ConfigFile]] = {}
    for file, path in zip(loads, paths, strict=True):
        same = next((known for known in loaded if known.samefile(path)), path)
        loaded.setdefault(same, []).append(file)
    return tuple(EditedFile(path, tuple(several), text := _as_it_is(path), text) for path, several in loaded.items())


def _as_it_is(path: Path) -> str:
    return read_small_text(path, as_it_is=True)


def _set(file: EditedFile, setting: Setting, wanted: Wanted, *, unsure: bool) -> None:
    after = text_for(file.format, wanted.option, wanted.value)
    earlier = next(
        (edit for edit in file.edits if edit.setting is not None and _is_same(file, edit.setting, setting)), None
    )
    if earlier is not None:
        if earlier.after != after:
            raise ConfigError(
                f"{earlier.parameters[0]} and {wanted.parameter} want different values on one line.",
                hint=_APART,
                where=setting.source,
            )
        earlier.parameters.append(wanted.parameter)
        earlier.shared.discard(setting.name)
        return
    file.after = _with_line(file.after, file.format, setting, after)
    notes = ["takes effect after a restart"] if wanted.option.reboot_required else []
    if unsure:
        notes.append("the file does not say whose parameter this is: every node that loads it gets the value")
    if wanted.driven is not None and _differs(setting.value, wanted.driven):
        notes.append(_not_driven(setting, wanted))
    others = [load for load in file.loads if load.settings.get(setting.name) is not setting]
    shared = {other.name for load in others for other in load.settings.values() if _is_same(file, setting, other)}
    file.edits.append(Edit(setting.source, [wanted.parameter], setting, after, notes, shared))


def _differs(value: float | str, driven: float) -> bool:
    """By more than a report rounds."""
    number = as_number(value)
    return number is not None and not math.isclose(number, driven, rel_tol=_ROUNDED, abs_tol=_ROUNDED)


def _not_driven(setting: Setting, wanted: Wanted) -> str:
    """A robot that does not drive with what its file says will not do so after a change of the file either."""
    if same_value(setting.value, wanted.value):
        return f"the file has this already, and the robot ran {shown(wanted.driven)}: changed since, or another file"
    return f"the file has {shown(setting.value)} but the robot ran {shown(wanted.driven)}: this is not the file it used"


def _is_same(file: EditedFile, one: Setting, other: Setting) -> bool:
    """Whether two settings are one value of a file that is loaded more than once."""
    return one.source == other.source and _bare_name(file, one) == _bare_name(file, other)


def _bare_name(file: EditedFile, setting: Setting) -> str:
    """A setting's name without the namespace that the file is loaded into."""
    namespace = next(load.namespace for load in file.loads if load.settings.get(setting.name) is setting)
    return setting.name.lstrip("/").removeprefix(namespace.strip("/")).lstrip("/")


def _with_line(text: str, format: Dialect, setting: Setting, after: str) -> str:
    """The text with another value on the line of a setting; unchanged where that line is not of a plain form."""
    lines = text.splitlines(keepends=True)
    index = int(setting.source.rpartition(":")[2]) - 1
    body = lines[index].rstrip("\r\n")
    key = re.escape(re.split(r"[/.]", setting.name)[-1])
    match = re.fullmatch(format.line.format(key=key), body)
    if match is not None:
        lines[index] = f"{match[1]}{after}{match[3]}{lines[index][len(body) :]}"
    return "".join(lines)


def _check(file: EditedFile) -> None:
    """Raise ConfigError where the edited text does not read as the old one with the new values."""
    if _reads_back(file, file.after, file.edits):
        return
    for edit in file.edits:
        if edit.setting is None:
            continue
        alone = _with_line(file.before, file.format, edit.setting, edit.after)
        if not _reads_back(file, alone, [edit]):
            break
    raise ConfigError(
        f"{edit.parameters[0]} cannot be changed in place: its value is not plain on its line.",
        hint=f"Set it to {edit.after} by hand.",
        where=edit.where,
    )


def check_written(file: EditedFile, path: Path) -> None:
    """Raise ConfigError where the file that was written does not read as it was meant to."""
    if not _reads_back(file, _as_it_is(path), file.edits):
        raise ConfigError(
            "The file that was written does not hold the changes.",
            hint="The old one is back. Is the disk full, or does another program write to it?",
            where=str(path),
        )


def check_held(text: str, format: Dialect, wanted: Sequence[Wanted]) -> None:
    """Raise ConfigError where a text of that format does not read as exactly these parameters with their values."""
    file = ConfigFile("", format, format.functions.read(text, Path("changes")))
    held = resolve([file], [one.parameter for one in wanted])
    for one in wanted:
        setting = held.get(one.parameter)
        if setting is None or not _is(setting.value, text_for(format, one.option, one.value)):
            raise ConfigError(f"{one.parameter} cannot be written into such a file.", hint="Set it by hand.")
    if len(file.settings) != len({one.parameter for one in wanted}):
        raise ConfigError("The changes cannot be written into such a file.", hint="Set them by hand.")


def _reads_back(file: EditedFile, text: str, edits: Sequence[Edit]) -> bool:
    """Whether a text holds what was changed and added, and everything else as before."""
    return all(_reads_back_in(file, load, text, edits) for load in file.loads)


def _reads_back_in(file: EditedFile, load: ConfigFile, text: str, edits: Sequence[Edit]) -> bool:
    try:
        now = read_text(text.lstrip("\ufeff"), file.path, load.namespace)
    except ConfigError:
        return False
    lines = {edit.where for edit in edits if edit.setting is not None}
    new_values = {
        (edit.where, _bare_name(file, edit.setting)): edit.after for edit in edits if edit.setting is not None
    }
    added = {edit.parameters[0]: edit.after for edit in edits if edit.setting is None}
    if now.format is not load.format or now.settings.keys() != load.settings.keys() | added.keys():
        return False
    if not all(_is(now.settings[name].value, after) for name, after in added.items()):
        return False
    for name, before in load.settings.items():
        value = now.settings[name].value
        new = new_values.get((before.source, _bare_name(file, before))) if before.source in lines else None
        if not (shown(value) == shown(before.value) if new is None else _is(value, new)):
            return False
    return True


def _is(value: float | str, text: str) -> bool:
    if isinstance(value, str):
        return value == text
    try:
        return shown(value) == shown(float(text))
    except ValueError:
        return False


def _add(files: Sequence[EditedFile], wanted: Wanted) -> None:
    file = next((f for f in files if not f.format.is_yaml), None)
    if file is None:
        raise ConfigError(
            f"No file holds {wanted.parameter}.",
            hint="Name the file that does, with its namespace if it has none (NAMESPACE=FILE), or add the line to it.",
            where=", ".join(str(f.path) for f in files),
        )
    after = text_for(file.format, wanted.option, wanted.value)
    end = "\r\n" if "\r\n" in file.after else "\n"
    separator = "" if not file.after or file.after.endswith(("\n", "\r")) else end
    if file.format is QGC_PARAMS:
        row = f"1\t1\t{wanted.parameter}\t{after}\t{6 if wanted.option.type in ('int', 'bool', 'enum') else 9}"
    else:
        row = f"{wanted.parameter},{after}"
    file.after += f"{separator}{row}{end}"
    where = f"{file.path}:{len(file.after.splitlines())}"
    file.edits.append(Edit(where, [wanted.parameter], None, after, ["no file has it: added at the end"]))

"""Changes put into configuration files: only the value on the line concerned is touched.

Comments, order, spacing and line ends stay, since nothing is parsed and written again: the reader says on which line a
parameter is, and the value there is replaced. The edited text is then read once more, so a line that cannot be edited
safely is refused, never damaged.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from care_core.configs.formats import ConfigFormat, text_for
from care_core.configs.loading import ConfigFile, guesses, read_configs, read_text, resolve, split_name
from care_core.errors import ConfigError
from care_core.run import Setting, shown
from care_core.variables import Variable

_YAML_VALUE = (
    r"""((?:[^#\n]*?[\s{{,]|\s*)["']?[\w/.~]*{key}["']?\s*:\s+)("[^"]*"|'[^']*'|[^\s#&*!|>\[{{,}}][^\s#,}}]*)(.*)"""
)
_LINES = {
    ConfigFormat.ARDUPILOT_PARAM: r"(\s*{key}(?:\s*,\s*|\s+))([^\s,#]+)(.*)",
    ConfigFormat.QGC_PARAMS: r"(\s*\d+\t\d+\t{key}\t)([^\t]+)(\t.*)",
    ConfigFormat.ROS1_YAML: _YAML_VALUE,
    ConfigFormat.ROS2_YAML: _YAML_VALUE,
}
"""Before the value, the value, behind it."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """A parameter to set, by the name that the log has for it."""

    option: Variable
    parameter: str
    value: float


@dataclass(slots=True)
class Edit:
    """What was done on one line. `before` is None for a parameter that was added."""

    where: str
    """file:line"""
    parameters: list[str]
    before: float | str | None
    after: str
    notes: list[str]


@dataclass(slots=True)
class EditedFile:
    """A file with its text before and after."""

    path: Path
    namespace: str
    held: ConfigFile
    before: str
    after: str
    edits: list[Edit] = field(default_factory=list)


def apply_changes(names: Sequence[str], wanted: Sequence[Wanted]) -> tuple[EditedFile, ...]:
    """The files' new texts; nothing is written.

    Args:
        names: files in the order they are loaded, `FILE` or for ROS `NAMESPACE=FILE`.
        wanted: the parameters to set. One that no file holds is added to a file of vehicle parameters, whose names are
            unique; in YAML it is refused.

    Raises:
        ConfigError: a file cannot be read, or a parameter cannot be set in any of them.
    """
    files = [_opened(held, *split_name(name)) for held, name in zip(read_configs(names), names, strict=True)]
    held = [file.held for file in files]
    found = resolve(held, [one.parameter for one in wanted])
    unsure = {parameter for named in guesses(held, found).values() for parameter in named}
    for one in wanted:
        setting = found.get(one.parameter)
        if setting is None:
            _add(files, one)
        else:
            file = next(file for file in files if file.held.settings.get(setting.name) is setting)
            _set(file, setting, one, unsure=one.parameter in unsure)
    return tuple(files)


def _opened(held: ConfigFile, path: Path, namespace: str) -> EditedFile:
    with path.open(encoding="utf-8", newline="") as stream:  # as it is, with its line ends
        text = stream.read()
    return EditedFile(path, namespace, held, text, text)


def _set(file: EditedFile, setting: Setting, one: Wanted, *, unsure: bool) -> None:
    after = text_for(file.held.format, one.option, one.value)
    earlier = next((edit for edit in file.edits if edit.where == setting.source), None)
    if earlier is not None:
        if earlier.after != after:
            raise ConfigError(
                f"{earlier.parameters[0]} and {one.parameter} want different values on one line.",
                hint="Give each its own line.",
                where=setting.source,
            )
        earlier.parameters.append(one.parameter)
        return
    lines = file.after.splitlines(keepends=True)
    index = int(setting.source.rpartition(":")[2]) - 1
    lines[index] = _with_value(lines[index], file.held.format, setting, after)
    edited = "".join(lines)
    if not _reads_back(file, edited, setting, after):
        raise ConfigError(
            f"{one.parameter} cannot be changed in place: its value is not plain on its line.",
            hint=f"Set it to {after} by hand.",
            where=setting.source,
        )
    file.after = edited
    notes = ["takes effect after a restart"] if one.option.reboot_required else []
    if unsure:
        notes.append("the file does not say whose parameter this is: every node that loads it gets the value")
    file.edits.append(Edit(setting.source, [one.parameter], setting.value, after, notes))


def _with_value(line: str, format: ConfigFormat, setting: Setting, after: str) -> str:
    """The line with another value; unchanged where it is not of a plain form."""
    body = line.rstrip("\r\n")
    key = re.escape(re.split(r"[/.]", setting.name)[-1])
    match = re.fullmatch(_LINES[format].format(key=key), body)
    return line if match is None else f"{match[1]}{after}{match[3]}{line[len(body) :]}"


def _reads_back(file: EditedFile, text: str, setting: Setting, after: str) -> bool:
    """Whether the edited text holds the new value, and every other one as before."""
    try:
        before = read_text(file.after.lstrip("\ufeff"), file.path, file.namespace)
        now = read_text(text.lstrip("\ufeff"), file.path, file.namespace)
    except ConfigError:
        return False
    others = {name: shown(one.value) for name, one in before.settings.items() if name != setting.name}
    kept = {name: shown(one.value) for name, one in now.settings.items() if name != setting.name}
    held = now.settings.get(setting.name)
    return now.format is before.format and others == kept and held is not None and _is(held.value, after)


def _is(value: float | str, text: str) -> bool:
    if isinstance(value, str):
        return value == text
    try:
        return shown(value) == shown(float(text))
    except ValueError:
        return False


def _add(files: Sequence[EditedFile], one: Wanted) -> None:
    file = next((f for f in files if f.held.format in (ConfigFormat.ARDUPILOT_PARAM, ConfigFormat.QGC_PARAMS)), None)
    if file is None:
        raise ConfigError(
            f"No file holds {one.parameter}.",
            hint="Name the file that does, with its namespace if it has none (NAMESPACE=FILE), or add the line to it.",
            where=", ".join(str(f.path) for f in files),
        )
    after = text_for(file.held.format, one.option, one.value)
    end = "\r\n" if "\r\n" in file.after else "\n"
    separator = "" if not file.after or file.after.endswith(("\n", "\r")) else end
    if file.held.format is ConfigFormat.QGC_PARAMS:
        row = f"1\t1\t{one.parameter}\t{after}\t{6 if one.option.type in ('int', 'bool', 'enum') else 9}"
    else:
        row = f"{one.parameter},{after}"
    file.after += f"{separator}{row}{end}"
    where = f"{file.path}:{len(file.after.splitlines())}"
    file.edits.append(Edit(where, [one.parameter], None, after, ["no file held it: added at the end"]))

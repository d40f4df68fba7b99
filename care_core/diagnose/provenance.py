"""Where the values of a run's configuration came from, in sentences: what files gave, contradicted, or could not."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from care_core.configs.driven import disagreements, readable
from care_core.configs.loading import ConfigFile, guesses, resolve
from care_core.profile.schema import Schema
from care_core.run import Run, Setting, shown
from care_core.text import log_time

_SHOWN = 5


def notes(schema: Schema, run: Run, files: Sequence[ConfigFile], given: Mapping[str, Setting]) -> tuple[str, ...]:
    """What the operator should know about the configuration of a run.

    Args:
        files: the configuration files that were named.
        given: what they say of the profile's parameters (`care_core.configs.resolve`).
    """
    return (
        *_changed_on_the_way(schema, run),
        *_from_files(schema, run, files),
        *disagreements(schema.options, run.settings, given),
        *_useless(schema, files),
        *_guessed(files, given),
    )


def _changed_on_the_way(schema: Schema, run: Run) -> Iterator[str]:
    for option in schema.options:
        for parameter in readable(option):
            first, *later = run.changes.get(parameter, (None,))
            if first is not None:
                steps = ", ".join(f"to {shown(one.value)} at {log_time(one.changed_at_s)}" for one in later)
                changes = f"from {shown(first.value)} {steps}"
                judged = f"{shown(run.settings[parameter].value)}, as in most of the {option.phase or 'mission'}"
                yield f"{option.name} was changed during the mission {changes}; judged is {judged}"


def _from_files(schema: Schema, run: Run, files: Sequence[ConfigFile]) -> Iterator[str]:
    """Per file, the options whose value only it held, with their lines."""
    from_file = {setting.source for file in files for setting in file.settings.values()}
    taken: dict[str, list[str]] = {}
    for name, source in run.sources.items():
        if source in from_file:
            path, _, line = source.rpartition(":")
            taken.setdefault(path, []).append(f"{name} = {schema.variables[name].show(run.config[name])} (line {line})")
    for path, values in taken.items():
        yield f"not in the log, taken from {path}: {', '.join(values)}"


def _useless(schema: Schema, files: Sequence[ConfigFile]) -> Iterator[str]:
    wanted = [parameter for option in schema.options for parameter in readable(option)]
    for file in files:
        if not file.settings:
            yield f"{file.path} holds nothing"
        elif not resolve([file], wanted):
            yield f"{file.path} holds nothing that profile {schema.name} knows"


def _guessed(files: Sequence[ConfigFile], given: Mapping[str, Setting]) -> Iterator[str]:
    for path, parameters in guesses(files, given).items():
        more = f" and {len(parameters) - _SHOWN} more" if len(parameters) > _SHOWN else ""
        shown = ", ".join(parameters[:_SHOWN]) + more
        yield f"{path} names no namespace, so it was taken for {shown}; to be sure write --config NAMESPACE={path}"

"""`campaign.yaml`: what an operator writes about a campaign, checked key by key and turned into plain records.

pydantic stays inside this module; the rest of the room sees `Campaign`.
"""

from __future__ import annotations

import hashlib
import os
import shlex
import string
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from care_core import plain_yaml
from care_core.collect.sampling import Method
from care_core.collect.space import Axis, Space
from care_core.configs.driven import option_value, readable
from care_core.configs.loading import read_configs, resolve, split_name
from care_core.constraints import parse_constraint
from care_core.errors import UsageError, nearest
from care_core.files import PROFILE_FILE, profile_folders, read_small_text
from care_core.profile.schema import Schema
from care_core.profile.store import load_profile
from care_core.records import Record
from care_core.run import Setting
from care_core.variables import Variable

PLACEHOLDERS = ("params", "logs", "run", "seed", "slot", "python")
"""What a command may name beside options: parameter file, folder for logs, number and seed of the run, slot, Python."""


class _Campaign(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    schema_version: Literal[1]
    profile: str
    command: str | list[str]
    parameters: str | list[str]
    runs: int = Field(ge=1, le=1_000_000)
    seed: int = Field(default=0, ge=0, lt=2**31)
    sampling: Method = "sobol"
    at_reference: float = Field(default=0.5, ge=0, le=0.95)
    repeats: float = Field(default=0.1, ge=0, le=0.5)
    reference: float = Field(default=0.0, ge=0, le=0.5)
    options: list[str] | dict[str, tuple[float, float] | None] | None = None
    limits: list[str] = Field(default_factory=list)
    slots: int = Field(default=1, ge=1, le=256)
    time_limit_s: float = Field(default=600.0, gt=0)
    retries: int = Field(default=1, ge=0, le=20)
    stop_after: int = Field(default=5, ge=1)
    batch: int | None = Field(default=None, ge=1)
    tell_apart: tuple[str, str] | None = None

    @field_validator("options", mode="after")
    @classmethod
    def _are_ranges(cls, options: Any) -> Any:
        for name, bounds in options.items() if isinstance(options, dict) else ():
            if bounds is not None and not bounds[0] < bounds[1]:
                raise ValueError(f"the range of '{name}' must be [low, high] with low < high")
        return options

    @model_validator(mode="after")
    def _belongs_together(self) -> _Campaign:
        adaptive = self.sampling == "adaptive"
        if not adaptive and (self.batch is not None or self.tell_apart is not None):
            raise ValueError("'batch' and 'tell_apart' belong to 'sampling: adaptive'")
        return self


class Campaign(Record, eq=False):
    """A campaign that is sound: every path found, every option known, the reference within all limits."""

    path: Path
    schema: Schema
    command: tuple[str, ...]
    """Words with placeholders; run as they are, without a shell."""
    parameters: tuple[str, ...]
    """Parameter files to change and hand to the command: `FILE` or `NAMESPACE=FILE`."""
    space: Space
    runs: int
    seed: int
    sampling: Method
    at_reference: float
    repeats: float
    reference: float
    slots: int
    time_limit_s: float
    retries: int
    stop_after: int
    batch: int
    """Adaptive: so many runs are chosen at a time."""
    tell_apart: tuple[str, str] | None
    digest: str
    """Of what the plan and the rows depend on: a command may be corrected between two calls, a range may not."""

    @property
    def folder(self) -> Path:
        return self.path.parent


def read_campaign(path: Path) -> Campaign:
    """Read and check a campaign.

    Raises:
        UsageError: no such file, or a key or value that does not belong, with the nearest known one.
        ProfileError: the profile is unsound.
        ConfigError: a parameter file cannot be read.
    """
    data = _checked(path)
    schema = load_profile(_profile_place(data.profile, path.parent)).schema
    if not schema.logs:
        raise UsageError(f"Profile '{schema.name}' reads no logs.", hint="Name the robot's own.", where=str(path))
    named = [data.parameters] if isinstance(data.parameters, str) else data.parameters
    parameters = tuple(_beside(name, path.parent) for name in named)
    try:
        space = _space(data, schema, parameters)
        command = _command(data.command, schema)
        apart = _apart(data.tell_apart, space)
    except UsageError as err:
        raise UsageError(err.message, hint=err.hint, where=f"{path}: {err.where}".removesuffix(": ")) from err
    return Campaign(
        path=path,
        schema=schema,
        command=command,
        parameters=parameters,
        space=space,
        runs=data.runs,
        seed=data.seed,
        sampling=data.sampling,
        at_reference=data.at_reference,
        repeats=data.repeats,
        reference=data.reference,
        slots=data.slots,
        time_limit_s=data.time_limit_s,
        retries=data.retries,
        stop_after=data.stop_after,
        batch=data.batch or max(data.slots, 10),
        tell_apart=apart,
        digest=_digest(data, space, schema),
    )


def _checked(path: Path) -> _Campaign:
    try:
        data = plain_yaml.load(read_small_text(path, encoding="utf-8-sig"))
    except OSError as err:
        hint = "Check the path."
        raise UsageError(f"Cannot read the campaign: {err.strerror}.", hint=hint, where=str(path)) from err
    except UnicodeDecodeError as err:
        raise UsageError("Not a campaign: it is not text.", where=str(path)) from err
    except plain_yaml.PlainYamlError as err:
        raise UsageError(f"Not valid YAML: {err}.", hint="Correct the line.", where=str(path)) from err
    if not isinstance(data, dict):
        raise UsageError("A campaign is a mapping with 'profile', 'command', 'parameters', 'runs'.", where=str(path))
    try:
        return _Campaign.model_validate(data)
    except ValidationError as err:
        raise _explained(err, path) from err


def _explained(err: ValidationError, path: Path) -> UsageError:
    first = err.errors()[0]
    key = str(first["loc"][0]) if first["loc"] else ""
    if first["type"] == "extra_forbidden":
        return UsageError(f"Unknown key '{key}'.", hint=nearest(key, _Campaign.model_fields), where=str(path))
    if first["type"] == "missing":
        return UsageError(f"'{key}' is missing.", hint="Add it.", where=str(path))
    message = first["msg"].removeprefix("Value error, ").rstrip(".")
    told = f"'{key}': {message}." if key else f"{message[0].upper()}{message[1:]}."
    return UsageError(told, hint="Correct it and run the command again.", where=str(path))


def _profile_place(name: str, folder: Path) -> str:
    """The name of an installed profile, or the place of one beside the campaign."""
    if name in profile_folders():
        return name
    beside = folder / name
    is_there = (beside / PROFILE_FILE).is_file() or (beside.name == PROFILE_FILE and beside.is_file())
    return str(beside) if is_there else name


def _beside(name: str, folder: Path) -> str:
    """A parameter file as named in the campaign, from where the campaign lies."""
    namespace, equals, file = name.partition("=")
    if equals and not (folder / name).exists():
        return f"{namespace}={folder / file}"
    return str(folder / name)


def _space(data: _Campaign, schema: Schema, parameters: Sequence[str]) -> Space:
    reference = reference_of(schema, parameters)
    ranges, left_out = _ranges(data, schema, reference)
    axes = [Axis(schema.variables[name], *bounds) for name, bounds in ranges.items()]
    if not axes:
        raise UsageError("No option varies.", hint="Give one a range under 'options'.", where="options")
    known = [limit for limit in schema.constraints if limit.options <= reference.keys()]
    return Space(axes, reference, [*known, *(parse_constraint(text, reference) for text in data.limits)], left_out)


def reference_of(schema: Schema, parameters: Sequence[str]) -> dict[str, float]:
    """The reference value of each option: what the operator's files hold, else the profile's default.

    An option without either has none. Raises ConfigError for a file that cannot be read.
    """
    held = resolve(read_configs(parameters), [name for option in schema.options for name in readable(option)])
    found: dict[str, float] = {}
    for option in schema.options:
        value = _held_value(option, held)
        value = option.default if value is None else value
        if value is not None:
            found[option.name] = value
    return found


def _held_value(option: Variable, held: Mapping[str, Setting]) -> float | None:
    values = (option_value(option, held[name]) for name in readable(option) if name in held)
    return next((value for value in values if value is not None), None)


def _ranges(
    data: _Campaign, schema: Schema, reference: Mapping[str, float]
) -> tuple[dict[str, tuple[float, float]], list[tuple[str, str]]]:
    """The ranges of the options that vary, and the others with the reason."""
    asked = data.options if isinstance(data.options, dict) else dict.fromkeys(data.options or ())
    options = {option.name: option for option in schema.options}
    for name in asked:
        if name not in options:
            hint = nearest(name, options)
            raise UsageError(f"The profile has no parameter '{name}'.", hint=hint, where="options")
    ranges: dict[str, tuple[float, float]] = {}
    left_out: list[tuple[str, str]] = []
    for name, option in options.items():
        bounds = asked.get(name) or _own_range(option)
        reason = _why_not(option, bounds, reference)
        if data.options is not None and name not in asked:
            left_out.append((name, "not named under 'options'"))
        elif data.options is None and option.safety:
            left_out.append((name, "a safety option varies only where it is named under 'options'"))
        elif reason or bounds is None:
            if name in asked:
                raise UsageError(f"{name} cannot vary: {reason}.", hint="Take it out, or add that.", where="options")
            left_out.append((name, reason))
        else:
            ranges[name] = _within(option, bounds)
    return ranges, left_out


def _own_range(option: Variable) -> tuple[float, float] | None:
    if option.range is not None:
        return option.range
    if option.labels:
        codes = [code for code, _ in option.labels]
        return (min(codes), max(codes)) if len(codes) > 1 else None
    return (0.0, 1.0) if option.type == "bool" else None


def _why_not(option: Variable, bounds: tuple[float, float] | None, reference: Mapping[str, float]) -> str:
    if not readable(option):
        return "the profile does not say which parameter it is"
    if bounds is None:
        return "the profile gives it no range"
    if option.name not in reference:
        return "no parameter file holds it and the profile has no default"
    return ""


def _within(option: Variable, bounds: tuple[float, float]) -> tuple[float, float]:
    """The campaign's range, which may be narrower than the profile's acceptable values and never wider."""
    own = _own_range(option)
    if own is not None and not own[0] <= bounds[0] < bounds[1] <= own[1]:
        raise UsageError(
            f"The range {_span(bounds)} of {option.name} goes beyond the profile's {_span(own)}.",
            hint="Keep inside it, or change the profile.",
            where="options",
        )
    return bounds


def _span(bounds: tuple[float, float]) -> str:
    return f"{bounds[0]:g} to {bounds[1]:g}"


def _command(given: str | list[str], schema: Schema) -> tuple[str, ...]:
    try:
        words = tuple(shlex.split(given) if isinstance(given, str) else given)
    except ValueError as err:
        raise UsageError(f"The command cannot be split into words: {err}.", where="command") from err
    if not words:
        raise UsageError("The command is empty.", hint="Write what runs one mission.", where="command")
    known = (*PLACEHOLDERS, *(option.name for option in schema.options))
    for word in words:
        for name in _names_in(word):
            if name not in known:
                hint = nearest(name, known) or f"Write {{{{ and }}}} for brackets. Known: {', '.join(PLACEHOLDERS)}."
                raise UsageError(f"The command names '{{{name}}}'.", hint=hint, where="command")
    return words


def _names_in(word: str) -> list[str]:
    try:
        parts = list(string.Formatter().parse(word))
    except ValueError as err:
        hint = "Write {{ and }} for brackets."
        raise UsageError(f"'{word}' cannot be read: {err}.", hint=hint, where="command") from err
    if any(format or conversion for _, _, format, conversion in parts):
        raise UsageError(f"'{word}': a placeholder is a name in brackets.", hint="Leave the rest out.", where="command")
    return [name for _, name, _, _ in parts if name is not None]


def _apart(names: tuple[str, str] | None, space: Space) -> tuple[str, str] | None:
    known = [axis.name for axis in space.axes]
    for name in names or ():
        if name not in known:
            hint = nearest(name, known)
            raise UsageError(f"'{name}' does not vary in this campaign.", hint=hint, where="tell_apart")
    if names is not None and names[0] == names[1]:
        raise UsageError("Two different options are to be told apart.", where="tell_apart")
    return names


def _digest(data: _Campaign, space: Space, schema: Schema) -> str:
    plan = (
        [(axis.name, axis.low, axis.high) for axis in space.axes],
        sorted(space.reference.items()),
        [limit.text for limit in space.limits],
        (data.runs, data.seed, data.sampling, data.at_reference, data.repeats, data.batch, data.tell_apart),
        schema.digest,
        repr(sorted(schema.mission.items())),
        *([data.reference] if data.reference else ()),
    )
    return hashlib.sha256(repr(plan).encode()).hexdigest()


def default_folder(path: Path) -> Path:
    """Where a campaign's runs go unless told otherwise: a folder of its name beside it."""
    return path.with_suffix("") if path.suffix else path.with_name(f"{path.name}-runs")


def parameter_file_names(parameters: Sequence[str]) -> tuple[str, ...]:
    """The names that the changed files get in a run's folder: those of the originals. Raises UsageError for twins."""
    names = tuple(os.path.basename(split_name(name)[0]) for name in parameters)
    if len(set(names)) < len(names):
        raise UsageError("Two parameter files have the same name.", hint="Rename one.", where="parameters")
    return names

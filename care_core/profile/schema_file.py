"""`profile.yaml`: what people write about a platform, checked key by key and turned into plain records.

pydantic stays inside this module; the rest of the core sees `Schema` and `Variable`.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Literal, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from care_core import plain_yaml
from care_core.causal.nominal import nominal
from care_core.constraints import Constraint, parse_constraint
from care_core.ecosystems.vehicles import Kind as VehicleKind
from care_core.errors import ProfileError, UsageError, nearest
from care_core.logs import formats
from care_core.profile.patterns import repeats_of
from care_core.profile.schema import EvidenceRule, Schema, Side
from care_core.text import clean
from care_core.variables import (
    About,
    Events,
    Extract,
    Kind,
    Op,
    Role,
    Threshold,
    Typical,
    ValueType,
    Variable,
    is_parameter_name,
    is_variable_name,
)

_MOST_REPEATS = 2
"""One after the other in the regular expression of a rule, which is a stranger's as the message is that it meets."""
_PROFILE_NAME = re.compile(r"\w[\w .-]*")


class Strict(BaseModel):
    """What people write: a key that is not known is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class _Threshold(Strict):
    op: Op
    value: float


class Bound(Strict):
    """An objective's threshold: a value, a ratio to what the reference configuration needs, or a value for the
    profile's own mission and a ratio for any other."""

    op: Op
    value: float | None = None
    ratio: float | None = Field(default=None, gt=0)
    at_least: float | None = None

    @model_validator(mode="after")
    def _says_how(self) -> Bound:
        if self.value is None and self.ratio is None:
            raise ValueError("a threshold has a 'value' or a 'ratio'")
        if self.at_least is not None and self.ratio is None:
            raise ValueError("'at_least' belongs to a 'ratio'")
        return self

    def threshold(self) -> Threshold:
        """As the rest of the program knows it."""
        return Threshold(self.op, self.value, self.ratio, self.at_least)


class _Typical(Strict):
    kind: str
    at_least: float = Field(default=0.0, ge=0)
    at_most: float | None = Field(default=None, gt=0)


class _Variable(Strict):
    role: Role
    type: ValueType = "float"
    unit: str = ""
    doc: str = ""
    range: tuple[float, float] | None = None
    default: float | None = None
    values: dict[float, str] = Field(default_factory=dict)
    parameter: str | list[str] = Field(default_factory=list)
    reboot_required: bool = False
    modes: list[str] = Field(default_factory=list)
    phase: str = ""
    safety: bool = False
    ceiling: bool = False
    airframe: bool = False
    kind: Kind | None = None
    threshold: Bound | None = None
    grows: bool = False
    about: About = "world"
    typical: _Typical | None = None
    nominal: dict[str, str] | None = None
    accuracy: float = Field(default=0.0, ge=0, lt=1)
    events: dict[str, str] | None = None
    extract: dict[str, Any] | None = None
    order: int | None = None

    @field_validator("parameter")
    @classmethod
    def _are_parameters(cls, names: str | list[str]) -> str | list[str]:
        for name in [names] if isinstance(names, str) else names:
            if not is_parameter_name(name):
                raise ValueError(f"no parameter is called '{clean(name)}': letters, digits and _ . / - ~ make a name")
        return names

    @model_validator(mode="after")
    def _fits_what_it_is_about(self) -> _Variable:
        if self.about != "vehicle" and self.typical is not None:
            raise ValueError("only contexts about the vehicle have a 'typical' value")
        return self

    @model_validator(mode="after")
    def _fits_role(self) -> _Variable:
        if self.role is Role.OBJECTIVE and self.kind is None:
            raise ValueError("an objective needs 'kind': functional or non-functional")
        if self.role is not Role.OBJECTIVE and self.threshold is not None:
            raise ValueError("only objectives have a 'threshold'")
        if self.grows and (self.kind != "non-functional" or (self.threshold and self.threshold.op not in ("<", "<="))):
            raise ValueError("'grows' belongs to a non-functional objective with an upper threshold")
        if self.role is not Role.CONTEXT and self.about != "world":
            raise ValueError("only contexts are 'about' something")
        if self.role not in (Role.METRIC, Role.OBJECTIVE) and self.nominal is not None:
            raise ValueError("only metrics and objectives have a 'nominal'")
        if self.nominal is not None and "kind" not in self.nominal:
            raise ValueError("'nominal' needs 'kind', the name of a formula")
        if self.role is not Role.OBJECTIVE and self.accuracy:
            raise ValueError("only objectives have an 'accuracy'")
        if self.events is not None and (self.nominal is None or set(self.events) != {"count", "variation"}):
            raise ValueError("'events' has a 'count' and a 'variation', and belongs to a 'nominal'")
        if self.role is not Role.OPTION and self.parameter:
            raise ValueError("only options have a 'parameter'")
        if self.role is not Role.OPTION and (self.modes or self.phase):
            raise ValueError("only options have 'modes' and a 'phase', those that read it")
        if self.role is not Role.OPTION and (self.ceiling or self.airframe):
            raise ValueError("only options are a 'ceiling', or of an 'airframe'")
        if self.safety and self.default is None:
            raise ValueError("a 'safety' option needs 'default', the value past which it is never moved")
        if self.range is not None and self.range[0] >= self.range[1]:
            raise ValueError("'range' must be [low, high] with low < high")
        if self.extract is not None and "kind" not in self.extract:
            raise ValueError("'extract' needs 'kind', the name of an extractor")
        return self


class _Match(Strict):
    """What a log must say to be of this platform; each text is searched in the log's facts, ignoring case."""

    firmware: str = ""
    airframe: str = ""
    frame: str = ""
    stack: str = ""
    vehicle: str = ""
    versions: tuple[str, str] | None = None

    @field_validator("vehicle")
    @classmethod
    def _is_a_kind(cls, kind: str) -> str:
        if kind and kind not in get_args(VehicleKind):
            raise ValueError(f"there is no vehicle '{kind}'. {nearest(kind, get_args(VehicleKind))}".strip())
        return kind

    @field_validator("versions")
    @classmethod
    def _are_versions(cls, versions: tuple[str, str] | None) -> tuple[str, str] | None:
        if versions is not None and not all(re.fullmatch(r"\d+(\.\d+)*", version) for version in versions):
            raise ValueError("'versions' is [first, last], such as ['4.0', '4.7']")
        return versions


class _EvidenceRule(Strict):
    text: str
    options: list[str] | dict[str, _Threshold] = Field(default_factory=list)
    says: str = ""
    circumstance: str | None = None

    @field_validator("text")
    @classmethod
    def _is_pattern(cls, text: str) -> str:
        try:
            re.compile(text)
            repeats = repeats_of(text)
        except (re.error, RecursionError, OverflowError) as err:
            raise ValueError(f"not a regular expression: {err}") from None
        if repeats > _MOST_REPEATS:
            raise ValueError(
                f"looking for it may take for ever: write at most {_MOST_REPEATS} repetitions (*, +, {{m,n}}) one after"
                " the other, and neither | nor another inside one"
            )
        return text


class _Known(Strict):
    """What people know to act on what: every cause may act on every effect."""

    causes: list[str]
    effects: list[str]


class _Profile(Strict):
    schema_version: Literal[1]
    name: str
    version: str
    platform: str
    doc: str = ""
    match: _Match = _Match()
    logs: list[str] = Field(default_factory=list)
    observational: bool = False
    carried_over: str = ""
    plugins: dict[str, str | list[str]] = Field(default_factory=dict)
    limits: list[str] = Field(default_factory=list)
    mission: dict[str, Any] = Field(default_factory=dict)
    evidence: list[_EvidenceRule] = Field(default_factory=list)
    circumstances: dict[str, dict[str, Side]] = Field(default_factory=dict)
    known: list[_Known] = Field(default_factory=list)
    variables: dict[str, _Variable]

    @field_validator("name")
    @classmethod
    def _is_a_name(cls, name: str) -> str:
        if not _PROFILE_NAME.fullmatch(name):
            raise ValueError(f"no profile is called '{clean(name)}': letters, digits, spaces and _ . - make a name")
        return name

    @field_validator("variables")
    @classmethod
    def _are_names(cls, variables: dict[str, _Variable]) -> dict[str, _Variable]:
        for name in variables:
            if not is_variable_name(name):
                raise ValueError(f"no variable is called '{clean(name)}': letters, digits and _ . - make a name")
        return variables

    @field_validator("logs")
    @classmethod
    def _are_formats(cls, names: list[str]) -> list[str]:
        known = [format.name for format in formats.FORMATS]
        for name in names:
            if name not in known:
                raise ValueError(f"there is no log format '{name}'. {nearest(name, known)}".strip())
        return names

    @model_validator(mode="after")
    def _names_are_declared(self) -> _Profile:
        options = [name for name, variable in self.variables.items() if variable.role is Role.OPTION]
        met = [name for name, variable in self.variables.items() if variable.role in (Role.CONTEXT, Role.METRIC)]
        for text in self.limits:
            _constraint(text, options)
        for rule in self.evidence:
            _declared(rule.options, options, f"evidence '{rule.text}' names the option")
            if rule.circumstance is not None:
                _declared([rule.circumstance], self.circumstances, f"evidence '{rule.text}' names the circumstance")
        for name, sides in self.circumstances.items():
            _declared(sides, met, f"circumstance '{name}' names the context or metric")
        for known in self.known:
            _declared((*known.causes, *known.effects), self.variables, "Under 'known' stands")
        units = {name: variable.unit for name, variable in self.variables.items()}
        for variable in self.variables.values():
            if variable.nominal is not None:
                nominal(variable.nominal["kind"], _arguments(variable.nominal), units)
            if variable.typical is not None:
                nominal(variable.typical.kind, {}, units)
            if variable.events is not None:
                _declared(variable.events.values(), met, "'events' names the context or metric")
        return self


def _constraint(text: str, options: Iterable[str]) -> Constraint:
    """A limit between options. Raises ValueError."""
    try:
        return parse_constraint(text, dict.fromkeys(options))
    except UsageError as err:
        raise ValueError(f"under 'limits' {err.message} {err.hint}".strip()) from err


def _declared(names: Iterable[str], known: Iterable[str], what: str) -> None:
    known = tuple(known)
    for name in names:
        if name not in known:
            raise ValueError(f"{what} '{name}', which the profile does not declare. {nearest(name, known)}".strip())


def _arguments(nominal: Mapping[str, Any]) -> dict[str, str]:
    return {key: str(value) for key, value in nominal.items() if key != "kind"}


def parsed(text: str, path: Path) -> Schema:
    """Check the text of a `profile.yaml`; `path` names it in errors. Raises ProfileError."""
    try:
        data = plain_yaml.load(text)
    except plain_yaml.PlainYamlError as err:
        raise ProfileError(f"Not valid YAML: {err}.", hint="Correct the line.", where=str(path)) from err
    if not isinstance(data, dict):
        raise ProfileError("A profile is a mapping with 'name' and 'variables'.", where=str(path))
    for key in _unprintable(data, ""):
        hint = "Write it as plain text."
        raise ProfileError(f"'{clean(key)}' holds a character that steers a terminal.", hint=hint, where=str(path))
    try:
        return _to_schema(_Profile.model_validate(data))
    except ValidationError as err:
        raise _explain(err, path) from err


def _unprintable(value: object, key: str) -> Iterator[str]:
    """Keys of what holds a character that cannot be printed; line ends are of a longer text."""
    if isinstance(value, str) and not value.replace("\n", "").isprintable():
        yield key
    elif isinstance(value, Mapping):
        for name, part in value.items():
            inner = f"{key}.{name}".lstrip(".")
            yield from _unprintable(str(name).replace("\n", "\0"), inner)
            yield from _unprintable(part, inner)
    elif isinstance(value, list):
        for part in value:
            yield from _unprintable(part, key)


def _explain(err: ValidationError, path: Path) -> ProfileError:
    first = err.errors()[0]
    key = ".".join(str(part) for part in first["loc"])
    if first["type"] == "extra_forbidden":
        model = _Variable if first["loc"][0] == "variables" else _Profile
        hint = nearest(str(first["loc"][-1]), model.model_fields)
        return ProfileError(f"Unknown key '{key}'.", hint=hint, where=str(path))
    message = first["msg"].removeprefix("Value error, ").rstrip(".?") + ("?" if first["msg"].endswith("?") else ".")
    told = f"'{key}': {message}" if key else message[0].upper() + message[1:]
    return ProfileError(told, hint="Correct the key and run the command again.", where=str(path))


def _to_schema(data: _Profile) -> Schema:
    variables = {name: _to_variable(name, v) for name, v in data.variables.items()}
    return Schema(
        name=data.name,
        version=data.version,
        platform=data.platform,
        doc=data.doc,
        match={key: text for key, text in data.match.model_dump(exclude={"versions"}).items() if text},
        logs=tuple(data.logs),
        observational=data.observational,
        carried_over=data.carried_over,
        plugins={name: (one,) if isinstance(one, str) else tuple(one) for name, one in data.plugins.items()},
        constraints=tuple(_constraint(text, variables) for text in data.limits),
        mission=data.mission,
        evidence=tuple(map(_to_rule, data.evidence)),
        variables=variables,
        circumstances=data.circumstances,
        known=frozenset((a, b) for rule in data.known for a in rule.causes for b in rule.effects),
        firmware_window=None if data.match.versions is None else _window(*data.match.versions),
        digest=_digest(variables),
    )


def _window(first: str, last: str) -> tuple[tuple[int, ...], tuple[int, ...]]:
    low, high = (tuple(map(int, version.split("."))) for version in (first, last))
    return low, high


def _to_rule(rule: _EvidenceRule) -> EvidenceRule:
    bounds = rule.options if isinstance(rule.options, dict) else dict.fromkeys(rule.options)
    return EvidenceRule(
        text=rule.text,
        options={name: None if b is None else Threshold(b.op, b.value) for name, b in bounds.items()},
        says=rule.says,
        circumstance=rule.circumstance,
    )


def _to_variable(name: str, v: _Variable) -> Variable:
    extract = None
    if v.extract is not None:
        args = {key: value for key, value in v.extract.items() if key != "kind"}
        extract = Extract(str(v.extract["kind"]), args)
    return Variable(
        name=name,
        role=v.role,
        type=v.type,
        unit=v.unit,
        doc=v.doc,
        range=v.range,
        default=v.default,
        labels=tuple(v.values.items()),
        parameters=(v.parameter,) if isinstance(v.parameter, str) else tuple(v.parameter),
        reboot_required=v.reboot_required,
        modes=tuple(v.modes),
        phase=v.phase,
        safety=v.safety,
        ceiling=v.ceiling,
        airframe=v.airframe,
        kind=v.kind,
        threshold=None if v.threshold is None else v.threshold.threshold(),
        grows=v.grows,
        about=v.about,
        typical=None if v.typical is None else Typical(**v.typical.model_dump()),
        accuracy=v.accuracy,
        events=None if v.events is None else Events(**v.events),
        nominal=None if v.nominal is None else Extract(v.nominal["kind"], _arguments(v.nominal)),
        extract=extract,
        order=v.order,
    )


def _digest(variables: Mapping[str, Variable]) -> str:
    parts = [
        f"{v.name}|{v.role.value}|{v.type}|{v.range}|{v.labels}|{v.extract.kind if v.extract else ''}"
        f"|{sorted(v.extract.args.items()) if v.extract else ''}"
        f"{f'|{v.nominal.kind}|{sorted(v.nominal.args.items())}' if v.nominal else ''}"
        for v in variables.values()
    ]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()

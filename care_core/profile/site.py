"""The site file: an operator's own limits, read by every later triage. `care baseline` writes it, people may change it.

    schema: care.site/1
    limits:
      arducopter:                                       # the profile whose objectives these are
        mission_time: {op: "<=", ratio: 1.15}           # times what the reference configuration needs
        energy: {op: "<=", value: 15.2, mission: {path_length: 339.8, legs: 5}}

What `--threshold` gives wins over the site file, and the site file over the profile. A `value` holds for the mission
that stands beside it, for any where none does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from pydantic import Field, ValidationError, model_validator

from care_core import plain_yaml
from care_core.errors import ConfigError, nearest
from care_core.profile.schema import Bound, Schema, Strict
from care_core.variables import OwnLimit, Role, Variable

SITE_SCHEMA = "care.site/1"


class _Limit(Bound):
    mission: dict[str, float] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _is_one_of_both(self) -> _Limit:
        if self.value is not None and self.ratio is not None:
            raise ValueError("a limit has a 'value' or a 'ratio', not both")
        return self

    @model_validator(mode="after")
    def _mission_is_that_of_a_value(self) -> _Limit:
        if self.mission and self.value is None:
            raise ValueError("'mission' belongs to a 'value': a ratio holds for any mission")
        return self


class _SiteFile(Strict):
    schema_: Literal["care.site/1"] = Field(alias="schema")
    limits: dict[str, dict[str, _Limit]]


@dataclass(frozen=True, slots=True)
class Site:
    """Limits by profile and objective, and the file that they stand in."""

    path: Path
    limits: Mapping[str, Mapping[str, _Limit]]

    def applied(self, schema: Schema) -> Schema:
        """The schema with these limits in the place of the profile's own.

        Raises:
            ConfigError: the file limits what is no objective of the profile, or names what no context tells.
        """
        limits = self.limits.get(schema.name, {})
        changed = {name: self._limited(name, limit, schema) for name, limit in limits.items()}
        return replace(schema, variables={**schema.variables, **changed}) if changed else schema

    def _limited(self, name: str, limit: _Limit, schema: Schema) -> Variable:
        objectives = {v.name: v for v in schema.objectives if v.kind != "functional"}
        if name not in objectives:
            hint = nearest(name, objectives) or f"Known are {', '.join(objectives)}."
            raise ConfigError(f"'{name}' cannot be limited for '{schema.name}'.", hint=hint, where=str(self.path))
        contexts = [v.name for v in schema.of(Role.CONTEXT)]
        for context in limit.mission:
            if context not in contexts:
                hint = nearest(context, contexts)
                raise ConfigError(f"'{schema.name}' has no context '{context}'.", hint=hint, where=str(self.path))
        absolute, relative = limit.thresholds()
        own = OwnLimit(self.path.name, limit.mission)
        return replace(objectives[name], threshold=absolute, relative=relative, own_limit=own)


def site_path() -> Path:
    """Where the site file of this user is; it may not exist."""
    from platformdirs import user_config_path

    return user_config_path("care") / "site.yaml"


def load_site(path: Path | None = None) -> Site | None:
    """The site file that was named, else the user's own, None where they have none.

    Raises:
        ConfigError: the named file does not exist, or it is no site file, with the key that is wrong.
    """
    file = path or site_path()
    if path is None and not file.is_file():
        return None
    try:
        data = plain_yaml.load(file.read_text(encoding="utf-8"))
    except OSError as err:
        raise ConfigError(f"Cannot read the site file: {err.strerror}.", where=str(file)) from err
    except (plain_yaml.PlainYamlError, UnicodeDecodeError) as err:
        raise ConfigError("The site file is no YAML.", hint=str(err).splitlines()[0], where=str(file)) from err
    try:
        return Site(file, _SiteFile.model_validate(data).limits)
    except ValidationError as err:
        first = err.errors()[0]
        key = ".".join(map(str, first["loc"]))
        problem = first["msg"].removeprefix("Value error, ").rstrip(".")
        hint = f"'{key}': {problem}." if key else f"It begins with 'schema: {SITE_SCHEMA}'."
        raise ConfigError("This is no site file.", hint=hint, where=str(file)) from err

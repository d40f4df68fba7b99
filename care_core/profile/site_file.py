"""The text of a site file, checked key by key. pydantic stays in here: few have one."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field, ValidationError, model_validator

from care_core import plain_yaml
from care_core.errors import ConfigError
from care_core.files import read_small_text
from care_core.profile.schema_file import Bound, Strict

SITE_SCHEMA = "care.site/1"


class SiteLimit(Bound):
    mission: dict[str, float] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _is_one_of_both(self) -> SiteLimit:
        if self.value is not None and self.ratio is not None:
            raise ValueError("a limit has a 'value' or a 'ratio', not both")
        return self

    @model_validator(mode="after")
    def _mission_is_that_of_a_value(self) -> SiteLimit:
        if self.mission and self.value is None:
            raise ValueError("'mission' belongs to a 'value': a ratio holds for any mission")
        return self


class _SiteFile(Strict):
    schema_: Literal["care.site/1"] = Field(alias="schema")
    limits: dict[str, dict[str, SiteLimit]]


def limits_of(file: Path) -> dict[str, dict[str, SiteLimit]]:
    """Limits by profile and objective.

    Raises:
        ConfigError: there is no such file, or it is no site file, with the key that is wrong.
    """
    try:
        data = plain_yaml.load(read_small_text(file))
    except OSError as err:
        raise ConfigError(f"Cannot read the site file: {err.strerror}.", where=str(file)) from err
    except (plain_yaml.PlainYamlError, UnicodeDecodeError) as err:
        raise ConfigError("The site file is no YAML.", hint=str(err).splitlines()[0], where=str(file)) from err
    try:
        return _SiteFile.model_validate(data).limits
    except ValidationError as err:
        first = err.errors()[0]
        key = ".".join(map(str, first["loc"]))
        problem = first["msg"].removeprefix("Value error, ").rstrip(".")
        hint = f"'{key}': {problem}." if key else f"It begins with 'schema: {SITE_SCHEMA}'."
        raise ConfigError("This is no site file.", hint=hint, where=str(file)) from err

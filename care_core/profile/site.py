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
from pathlib import Path
from typing import TYPE_CHECKING

from care_core.errors import ConfigError, nearest
from care_core.profile.schema import Schema
from care_core.records import Record, replace
from care_core.variables import Role, Variable

if TYPE_CHECKING:
    from care_core.profile.site_file import SiteLimit


class Site(Record):
    """Limits by profile and objective, and the file that they stand in."""

    path: Path
    limits: Mapping[str, Mapping[str, SiteLimit]]

    def applied(self, schema: Schema) -> Schema:
        """The schema with these limits in the place of the profile's own.

        Raises:
            ConfigError: the file limits what is no objective of the profile, or names what no context tells.
        """
        limits = self.limits.get(schema.name, {})
        changed = {name: self._limited(name, limit, schema) for name, limit in limits.items()}
        return replace(schema, variables={**schema.variables, **changed}) if changed else schema

    def _limited(self, name: str, limit: SiteLimit, schema: Schema) -> Variable:
        objectives = {v.name: v for v in schema.objectives if v.kind != "functional"}
        if name not in objectives:
            hint = nearest(name, objectives) or f"Known are {', '.join(objectives)}."
            raise ConfigError(f"'{name}' cannot be limited for '{schema.name}'.", hint=hint, where=str(self.path))
        contexts = [v.name for v in schema.of(Role.CONTEXT)]
        for context in limit.mission:
            if context not in contexts:
                hint = nearest(context, contexts)
                raise ConfigError(f"'{schema.name}' has no context '{context}'.", hint=hint, where=str(self.path))
        own = replace(limit.threshold(), source=self.path.name, mission=limit.mission)
        return replace(objectives[name], threshold=own)


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
    from care_core.profile.site_file import limits_of

    return Site(file, limits_of(file))

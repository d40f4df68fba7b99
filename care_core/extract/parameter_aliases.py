"""A profile by the parameter names of the release that ran: its options under the names and units of the log."""

from __future__ import annotations

from care_core.ecosystems.ros.plugin_names import named_here
from care_core.ecosystems.vehicles import vehicle_of
from care_core.logs.base import Log
from care_core.metadata.aliases import alias_in
from care_core.profile.schema import Schema
from care_core.records import replace
from care_core.run import Settings
from care_core.variables import Role, Variable


def with_logged_names(schema: Schema, log: Log, known: Settings | None = None) -> Schema:
    """The schema with each option's parameter as the robot names it, and how its unit changed with the name.

    A robot that has a parameter under none of its names leaves the option as it is. `known`: what is known of its
    parameters, what the log holds unless given.
    """
    if log.format.name not in schema.logs:
        return schema
    logged = log.settings() if known is None else known
    kind = schema.match.get("stack") or vehicle_of(log.facts, log.settings()).kind
    if kind in ("unknown", "px4") or all(name in logged for option in schema.options for name in option.parameters):
        return schema
    if kind == "nav2":
        schema = _with_own_plugins(schema, logged)
    variables = {
        name: _with_logged_names(variable, logged, kind) if variable.role is Role.OPTION else variable
        for name, variable in schema.variables.items()
    }
    return replace(schema, variables=variables)


def _with_own_plugins(schema: Schema, logged: Settings) -> Schema:
    """The schema with plugins under the names that the robot gave them."""
    variables = {
        name: replace(one, parameters=tuple(named_here(key, logged) for key in one.parameters))
        for name, one in schema.variables.items()
    }
    plugins = {named_here(name, logged): texts for name, texts in schema.plugins.items()}
    return replace(schema, variables=variables, plugins=plugins)


def _with_logged_names(option: Variable, logged: Settings, kind: str) -> Variable:
    aliases = [alias_in(name, logged, kind) for name in option.parameters]
    if not aliases or any(alias is None for alias in aliases):
        return option
    names = tuple(alias.name for alias in aliases if alias is not None)
    scales = {alias.scale for alias in aliases if alias is not None}
    if len(scales) > 1 or (names == option.parameters and scales == {option.scale}):
        return option
    return replace(option, parameters=names, scale=scales.pop())

"""A profile in the words of the firmware that flew: its options under the names and units that the log has."""

from __future__ import annotations

from collections.abc import Mapping

from care_core.ecosystems.vehicles import Kind, spelled_in, vehicle_of
from care_core.logs.base import Log
from care_core.profile.schema import Schema
from care_core.records import replace
from care_core.variables import Role, Variable


def spelled(schema: Schema, log: Log) -> Schema:
    """The schema with each option's parameter as the log spells it, and how its unit changed with the name.

    A log that holds a parameter under none of its names leaves the option as it is.
    """
    if log.format.name not in schema.logs:
        return schema
    held = log.settings()
    kind = vehicle_of(log.facts, held).kind
    if kind in ("unknown", "px4") or all(name in held for option in schema.options for name in option.parameters):
        return schema
    variables = {
        name: _spelled(variable, held, kind) if variable.role is Role.OPTION else variable
        for name, variable in schema.variables.items()
    }
    return replace(schema, variables=variables)


def _spelled(option: Variable, held: Mapping[str, object], kind: Kind) -> Variable:
    found = [spelled_in(name, held, kind) for name in option.parameters]
    if not found or any(spelling is None for spelling in found):
        return option
    names = tuple(spelling.name for spelling in found if spelling is not None)
    scales = {spelling.scale for spelling in found if spelling is not None}
    if len(scales) > 1 or (names == option.parameters and scales == {option.scale}):
        return option
    return replace(option, parameters=names, scale=scales.pop())

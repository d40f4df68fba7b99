"""The changes that a report suggests, held against the profile: a report is a file, and may be a stranger's.

Whoever acts on one sets parameters that the profile declares, under a name that firmware gives them, and none else.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

from care_core.diagnose.outside.change import outside_option
from care_core.ecosystems.ros.plugin_names import is_named_alike
from care_core.ecosystems.vehicles import Kind
from care_core.ecosystems.vehicles.vehicle import Vehicle
from care_core.errors import ConfigError, nearest
from care_core.metadata.aliases import aliases_of
from care_core.metadata.ardupilot import known_in
from care_core.metadata.causal_map import FROM_FLIGHTS, OF_THIS_VEHICLE, Role, meaning_of
from care_core.metadata.navigation import mended
from care_core.profile.schema import Schema
from care_core.profile.store import Profile, installed_profile
from care_core.records import Record, replace
from care_core.report.document import ChangeEntry, FixEntry, FixSet, TriageDocument
from care_core.report.reading import profile_of
from care_core.text import clean, shortened
from care_core.variables import Variable, is_parameter_name

_KINDS: tuple[Kind, ...] = ("copter", "quadplane", "rover")
"""Whose parameters have names of their own."""
_KINDS_BY_WORD: dict[str, Kind] = {kind: kind for kind in _KINDS}
_MAKE_ANEW = "Do not act on this report: make one from the log with 'care triage LOG'."


class SuggestedChange(Record):
    """One change in the option's unit; the option under the names that the report's firmware has for it."""

    option: Variable
    before: float
    value: float
    is_assumed: bool
    key: str
    """Where in the report it stands."""


def report_profile(report: TriageDocument, path: Path) -> Profile:
    """The installed profile that a report was made with, by its name alone.

    Raises:
        UsageError: none fitted the report's log.
        ProfileError: none of that name is installed, or it is unsound.
    """
    return installed_profile(
        profile_of(report).name, where=f"{path}: profile.name", hint="Name the report's own with --profile FOLDER."
    )


def fix_sets(fix: FixEntry) -> Iterator[tuple[str, FixSet]]:
    """The fix of a report and its alternatives, each with its key."""
    yield "fix", fix
    for place, one in enumerate(fix.alternatives):
        yield f"fix.alternatives[{place}]", one


def suggested_changes(
    one: FixSet, schema: Schema, path: Path, key: str, roles: frozenset[Role] = FROM_FLIGHTS
) -> tuple[SuggestedChange, ...]:
    """The changes of a fix, or of an alternative, as the profile knows them.

    Args:
        key: where in the report it stands.
        roles: of the parameters outside the profile that it may be of.

    Raises:
        ConfigError: a change is of no option, of a parameter that is not the option's, or twice there.
    """
    changes = tuple(
        _suggested(change, schema, path, f"{key}.changes[{place}]", roles) for place, change in enumerate(one.changes)
    )
    if not changes:
        raise _strange("there is no change", path, f"{key}.changes")
    seen: set[str] = set()
    for change in changes:
        if change.option.name in seen:
            raise _strange(f"{change.option.name} is there twice", path, change.key)
        seen.add(change.option.name)
    return changes


def check_acceptable(change: SuggestedChange, path: Path) -> None:
    """Raise ConfigError for a value that the profile never suggests for the option."""
    option, value = change.option, change.value
    if not option.accepts(value):
        said = f"{option.name} is never set to {value:g}, acceptable are {option.acceptable}"
    elif option.type in ("int", "bool", "enum") and not value.is_integer():
        said = f"{option.name} is a whole number, not {value:g}"
    elif option.type == "bool" and value not in (0, 1):
        said = f"{option.name} is 0 or 1, not {value:g}"
    else:
        return
    raise _strange(said, path, f"{change.key}.to")


def _suggested(change: ChangeEntry, schema: Schema, path: Path, key: str, roles: frozenset[Role]) -> SuggestedChange:
    options = {option.name: option for option in schema.options}
    option = options.get(change.option) or _outside(change.option, schema, roles)
    if option is None and _outside(change.option, schema, OF_THIS_VEHICLE) is not None:
        said = f"{clean(change.option)} belongs to how this vehicle is wired or calibrated, which no report sets"
        raise ConfigError(f"{said}.", hint="Set it by hand, where it is right.", where=f"{path}: {key}.option")
    if option is None:
        said = f"profile '{schema.name}' has no parameter '{clean(change.option)}'"
        raise _strange(f"{said}. {nearest(change.option, options)}".rstrip(), path, f"{key}.option")
    named = (change.parameter,) if isinstance(change.parameter, str) else tuple(change.parameter)
    driven = _under(option, named, schema)
    if driven is None:
        shown = shortened(", ".join(map(clean, named)), 80)
        own = ", ".join(option.parameters)
        raise _strange(f"the change of {option.name} may set {own} alone, not {shown}", path, f"{key}.parameter")
    before = math.nan if change.from_ is None else float(change.from_) / driven.scale
    value = float(change.to) / driven.scale
    if math.isinf(before) or not math.isfinite(value):
        raise _strange(f"{option.name} needs a finite number", path, key)
    return SuggestedChange(driven, _digits(before), _digits(value), change.assumed, key)


def _outside(name: str, schema: Schema, roles: frozenset[Role]) -> Variable | None:
    """A parameter that no option of the profile sets, where the firmware documents it and it has one of these roles, or
    where a recording of a ROS robot shows its value."""
    vehicle = Vehicle(_KINDS_BY_WORD.get(schema.match.get("vehicle", ""), "unknown"), "", "", None)
    if schema.match.get("stack") and mended(name) and is_parameter_name(name) and roles >= FROM_FLIGHTS:
        return outside_option(name, None, vehicle)
    meaning = meaning_of(name, vehicle.kind) if is_parameter_name(name) else None
    if meaning is None or meaning.role not in roles or not known_in(name):
        return None
    return outside_option(name, None, vehicle)


def _digits(value: float) -> float:
    """Files and reports hold seven digits, which a change of unit must not add to."""
    return float(f"{value:.7g}")


def _under(option: Variable, named: tuple[str, ...], schema: Schema) -> Variable | None:
    """The option under these names, None where they are not all of its own, in its order, in one unit."""
    if named == option.parameters:
        return option
    own = schema.match.get("stack") or schema.match.get("vehicle")
    kinds = [kind for kind in (*_KINDS, "nav2") if kind == own] or _KINDS
    if own == "nav2" and len(named) == len(option.parameters) and all(map(is_named_alike, option.parameters, named)):
        return replace(option, parameters=named)
    for kind in kinds:
        spelled = [
            next((one for one in aliases_of(first, kind) if one.name == name), None)
            for first, name in zip(option.parameters, named, strict=False)
        ]
        scales = {one.scale for one in spelled if one is not None}
        if len(named) == len(option.parameters) and None not in spelled and len(scales) == 1:
            return replace(option, parameters=named, scale=scales.pop())
    return None


def _strange(said: str, path: Path, key: str) -> ConfigError:
    ended = said if said.endswith("?") else f"{said}."
    return ConfigError(f"The report cannot be acted on, '{key}': {ended}", hint=_MAKE_ANEW, where=str(path))

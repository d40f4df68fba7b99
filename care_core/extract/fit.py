"""How well a profile fits a log: stack, vehicle, firmware, and how much of its options and sources the log holds.

Asked before anything is judged. What the mission and its conditions add is known once the run is read.
"""

from __future__ import annotations

from collections.abc import Iterator

from care_core.ecosystems.vehicles import UNLIKE_ROVERS, Vehicle, vehicle_of
from care_core.extract.coverage import Coverage, a_vehicle, wrong_kind, wrong_vehicle
from care_core.logs.base import Log
from care_core.profile.schema import Schema
from care_core.run import FITS, NO_PROFILE_FOR, Fit, Settings

MOST = 0.7
"""Share of a profile's options, and of its sources, that a log holds when it fits: some sources stand in for others,
some speak only when something happens."""
LEAST = 0.3
"""Share of the sources below which hardly anything of a run can be seen."""
_SHIM, _BEHIND = "RotationShimController", ".primary_controller"
"""A controller that turns on the spot first and then hands over to another, which it names there."""


def fit_of(log: Log, coverage: Coverage, known: Settings | None = None) -> Fit:
    """How well a profile fits a log, with what is missing or differs; `known`: what is known of the robot's parameters,
    what the log holds unless given."""
    schema = coverage.schema
    settings = log.settings() if known is None else known
    vehicle = vehicle_of(log.facts, log.settings())
    obstacles = tuple(_obstacles(log, coverage, vehicle, settings))
    if obstacles:
        return Fit("no", obstacles)
    return FITS.with_objection(*_differences(log, schema, vehicle), *_lacks(coverage), *_unnamed(schema, settings))


def _obstacles(log: Log, coverage: Coverage, vehicle: Vehicle, settings: Settings) -> Iterator[str]:
    """Why nothing that the profile says of this log could be believed."""
    schema = coverage.schema
    other = wrong_kind(log, schema)
    if other:
        yield other
    elif strange := wrong_vehicle(schema, vehicle):
        yield strange
    elif (airframe := schema.match.get("airframe")) and log.facts.get("vehicle", airframe) != airframe:
        none = f", and {NO_PROFILE_FOR}VTOLs of PX4" if log.facts["vehicle"] == "VTOL" else ""
        yield f"it is for {a_vehicle(airframe)}, this is {a_vehicle(log.facts['vehicle'])}{none}"
    elif other := _other_plugin(schema, settings):
        yield other
    elif not coverage.found:
        yield "none of its parameters or sources are in the log"
    elif coverage.sources < LEAST * coverage.sources_wanted:
        verb = "is" if coverage.sources == 1 else "are"
        yield f"only {coverage.sources} of the {coverage.sources_wanted} messages that it reads {verb} in the log"


def _other_plugin(schema: Schema, settings: Settings) -> str:
    """Which part of the stack is another than the profile was learned with; '' where none is known."""
    for name, learned in schema.plugins.items():
        for setting in settings.get(name, ()):
            behind = settings.get(name.replace(".plugin", _BEHIND), ()) if _SHIM in str(setting.value) else ()
            told = " ".join(str(one.value) for one in (setting, *behind)).casefold()
            if not any(text.casefold() in told for text in learned):
                return f"{name} is {setting.value}, the profile was learned with {' or '.join(learned)}"
    return ""


def _unnamed(schema: Schema, settings: Settings) -> Iterator[str]:
    """What nobody says that the robot has, so that it may be another than the profile was learned with."""
    told = {key.casefold() for key in settings}
    learned = [
        " or ".join(texts)
        for name, texts in schema.plugins.items()
        if name not in settings and not any(text.casefold() in key for key in told for text in texts)
    ]
    if learned:
        yield f"nothing says that it drove with {' and '.join(learned)}, as in the profile's runs"


def _differences(log: Log, schema: Schema, vehicle: Vehicle) -> Iterator[str]:
    """What the log says of its robot that is not what the profile was learned on."""
    for key, text in schema.match.items():
        told = "" if key in ("vehicle", "airframe") else log.facts.get(key, "")
        if told and text.casefold() not in told.casefold():
            yield f"the log's {key} is '{told}', the profile is for '{text}'"
    if schema.learned_elsewhere:
        yield schema.learned_elsewhere
    if schema.match.get("vehicle") == "rover" and vehicle.name in UNLIKE_ROVERS:
        yield f"this is a {vehicle.name}, the profile was learned on wheels"
    if schema.match.get("vehicle") and vehicle.kind == "unknown":
        yield f"the log does not say what vehicle it is of, the profile is for {a_vehicle(schema.match['vehicle'])}"
    if schema.firmware_window is None:
        return
    low, high = schema.firmware_window
    if vehicle.version is None:
        own = "release of ArduPilot" if vehicle.firmware and vehicle.kind != "px4" else "firmware"
        yield f"the log does not say which {own} flew"
    elif not low <= vehicle.version[: len(low)] or not vehicle.version[: len(high)] <= high:
        flown = ".".join(map(str, vehicle.version))
        yield f"firmware {flown} is outside {_dotted(low)} to {_dotted(high)}, for which the profile was made"


def _lacks(coverage: Coverage) -> Iterator[str]:
    options = len(coverage.schema.options)
    if coverage.options < MOST * options:
        yield f"{coverage.options} of its {options} parameters are in the log"
    if coverage.sources < MOST * coverage.sources_wanted:
        yield f"{coverage.sources} of its {coverage.sources_wanted} sources are in the log"


def _dotted(version: tuple[int, ...]) -> str:
    return ".".join(map(str, version))

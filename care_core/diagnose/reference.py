"""The configuration that a run is judged against.

It is the operator's: a good run or a file where one was named, else the defaults that the vehicle itself recorded, else
those of the profile. A default in the log that no release of the firmware has is its vendor's, who may have set it
wrong: then the firmware's own is the reference. A vehicle that was tuned for its frame is judged by its own tune where
its operator names it, and a robot that is slower than the profile's by its own speed: nothing says that it can go
faster.
"""

from __future__ import annotations

from collections.abc import Collection, Container, Iterator, Mapping
from pathlib import Path

from care_core.causal.counterfactual import Config
from care_core.causal.model import Model
from care_core.configs.driven import option_setting, option_value, same_value
from care_core.ecosystems.vehicles import vehicle_of_run
from care_core.metadata.ardupilot import firmware_default
from care_core.profile.schema import Schema
from care_core.records import Record, replace
from care_core.run import Run, Setting, is_known

FIRMWARE = "PARM"
"""The record in which a vehicle's log tells its parameters with the firmware's defaults."""
_RELEASES_DIFFER = 2.0
"""The most by which one release's default of an option was a multiple of another's (PSC_VELXY_D of 4.5 and 4.6)."""


class Good(Record):
    """A configuration that the operator vouches for: parameters by their names in the log, and where they are from."""

    settings: Mapping[str, Setting]
    source: str


def reference_as_driven(path: str | Path) -> str:
    """Whose configuration it is that a log was driven with, in one phrase."""
    return f"the configuration of {Path(path).name}"


class Reference(Record, eq=False):
    """The reference configuration under what this run met, and in one phrase whose it is."""

    config: Config
    source: str


def profile_config(schema: Schema, model: Model) -> dict[str, float]:
    """The profile's own reference: declared defaults, else the middle of the training runs.

    Contexts are held at the middle of the training runs, until the run's own are known.
    """
    config: dict[str, float] = {}
    for variable in (*schema.options, *schema.contexts):
        if variable.default is not None:
            config[variable.name] = variable.default
        elif variable.name in model.summaries:
            quantiles = model.summaries[variable.name].quantiles
            config[variable.name] = variable.snap(quantiles[len(quantiles) // 2])
    return config


def reference_of(run: Run, schema: Schema, model: Model, good: Good | None = None) -> Reference:
    """The reference configuration for a run: a context is met, not set."""
    config = profile_config(schema, model)
    named, recorded, vendors = _named(schema, good), _recorded(run, schema), _vendors(run, schema)
    recorded |= {name: ours for name, (_, ours) in vendors.items()}
    for name, value in {**recorded, **named}.items():
        # A value that may not be suggested is no reference, but where it is driven it is none to be off either.
        if schema.variables[name].accepts(value) or (name in named and _is_same(value, run.config.get(name))):
            config[name] = value
    config.update(_as_trained(run, profile_config(schema, model), recorded, named))
    config.update(dict(_of_the_airframe(run, schema, recorded, named)))
    lower = {name: own for name, own in _ceilings(run, schema) if name not in named and own < config.get(name, own)}
    config.update(lower)
    config.update({name: value for name, value in run.context.items() if is_known(value)})
    others = [
        f"{name} {theirs:g} (the firmware's {ours:g})" for name, (theirs, ours) in vendors.items() if name not in named
    ]
    vendor = f", but not what a vendor made the default, {', '.join(others)}" if others else ""
    slower = f", {', '.join(lower)} as low as this robot's" if lower else ""
    return Reference(config, _whose(named, recorded, good) + vendor + slower)


def _as_trained(run: Run, trained: Config, recorded: Collection[str], named: Container[str]) -> dict[str, float]:
    """Options that were driven at the profile's own reference, where the log's default is another: the runs that
    training knows to be sound had that value."""
    own = {name: run.config.get(name) for name in recorded if name in trained and name not in named}
    return {name: trained[name] for name, value in own.items() if _is_same(trained[name], value)}


def _vendors(run: Run, schema: Schema) -> dict[str, tuple[float, float]]:
    """Options whose default in the log no release of the firmware has, with the firmware's."""
    kind = vehicle_of_run(run).kind
    found: dict[str, tuple[float, float]] = {}
    for option in schema.options:
        setting = option_setting(option, run.settings)
        recorded = None if setting is None else _by_default(setting)
        own = None if recorded is None else firmware_default(recorded.name, kind)
        if recorded is None or own is None or not isinstance(recorded.value, (int, float)):
            continue
        theirs, ours = (option_value(option, replace(recorded, value=value)) for value in (recorded.value, own))
        if theirs is not None and ours is not None and not _may_be_a_release(float(recorded.value), own):
            found[option.name] = theirs, ours
    return found


def _may_be_a_release(recorded: float, firmware: float) -> bool:
    """Whether a default may be that of another release: those differ by less than so much."""
    if firmware == 0 or recorded == 0:
        return recorded == firmware
    return 1 / _RELEASES_DIFFER <= recorded / firmware <= _RELEASES_DIFFER


def _of_the_airframe(
    run: Run, schema: Schema, recorded: Mapping[str, float], named: Container[str]
) -> Iterator[tuple[str, float]]:
    """The run's own values of options that are chosen for an airframe, where nobody names others and the defaults in
    the log are those of a firmware that knows no airframe."""
    for option in schema.options:
        own, default = run.config.get(option.name), option.default
        if not option.airframe or own is None or default is None or option.name in named:
            continue
        if option.name in recorded and not same_value(recorded[option.name], default):
            yield option.name, own


def _ceilings(run: Run, schema: Schema) -> Iterator[tuple[str, float]]:
    """The run's values of options that bound how fast its robot goes."""
    for option in schema.options:
        own = run.config.get(option.name)
        if option.ceiling and own is not None:
            yield option.name, own


def _is_same(value: float, other: float | None) -> bool:
    """Whether a parameter has this value."""
    return other is not None and same_value(value, other)


def _named(schema: Schema, good: Good | None) -> dict[str, float]:
    """Options by the configuration that the operator vouches for."""
    return {} if good is None else _options(schema, good.settings)


def _recorded(run: Run, schema: Schema) -> dict[str, float]:
    """Options by the defaults that the log records."""
    defaults = {name: at for name, setting in run.settings.items() if (at := _by_default(setting)) is not None}
    return _options(schema, defaults)


def _options(schema: Schema, settings: Mapping[str, Setting]) -> dict[str, float]:
    values: dict[str, float] = {}
    for option in schema.options:
        setting = option_setting(option, settings)
        value = None if setting is None else option_value(option, setting)
        if value is not None:
            values[option.name] = value
    return values


def _whose(named: Collection[str], recorded: Collection[str], good: Good | None) -> str:
    """Whose the reference is, in one phrase."""
    if good is None:
        return "the firmware defaults stored in the log" if recorded else "the profile's reference"
    if not named:
        return f"{_whose((), recorded, None)}, as {good.source} holds no option"
    lacking = len(set(recorded) - set(named))
    if not lacking:
        return good.source
    return f"{good.source} and, for what it lacks ({lacking}), the firmware defaults stored in the log"


def _by_default(setting: Setting) -> Setting | None:
    """The setting at the default of the vehicle's firmware. A ROS node's own default is no configuration of a robot."""
    if setting.source != FIRMWARE or setting.default is None:
        return None
    return replace(setting, value=setting.default)

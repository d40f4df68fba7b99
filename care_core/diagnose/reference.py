"""The configuration that a run is judged against, and what it would need for the mission of this run.

It is the operator's: a good run or a file where one was named, else the defaults that the vehicle itself recorded, else
those of the profile. A vehicle that was tuned for its frame is judged by its own tune where its operator names it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from care_core.causal.counterfactual import Config, World
from care_core.causal.model import Model
from care_core.configs.driven import option_setting, option_value
from care_core.diagnose.records import Need
from care_core.profile.schema import Schema
from care_core.run import Run, Setting, is_known

FIRMWARE = "PARM"
"""The record in which a vehicle's log tells its parameters with the firmware's defaults."""


@dataclass(frozen=True, slots=True)
class Good:
    """A configuration that the operator vouches for: parameters by their names in the log, and where they are from."""

    settings: Mapping[str, Setting]
    source: str


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
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
    given, source = _given(run, schema, good)
    config.update({name: value for name, value in given.items() if schema.variables[name].accepts(value)})
    config.update({name: value for name, value in run.context.items() if is_known(value)})
    return Reference(config, source)


def _given(run: Run, schema: Schema, good: Good | None) -> tuple[dict[str, float], str]:
    """Options by the operator's reference, or by the defaults that the log records, and whose they are."""
    values: dict[str, float] = {}
    for option in schema.options:
        setting = option_setting(option, run.settings if good is None else good.settings)
        if setting is not None and good is None:
            setting = _by_default(setting)
        value = None if setting is None else option_value(option, setting)
        if value is not None:
            values[option.name] = value
    if good is not None:
        return values, good.source
    return values, "the defaults that the log records" if values else "the profile's reference"


def _by_default(setting: Setting) -> Setting | None:
    """The setting at the default of the vehicle's firmware. A ROS node's own default is no configuration of a robot."""
    if setting.source != FIRMWARE or setting.default is None:
        return None
    return replace(setting, value=setting.default)


def need_of(name: str, world: World) -> Need | None:
    """What the reference configuration would need of an objective in this run's place; None where nothing tells."""
    if name not in world.model.outcomes:
        return None
    p = world.predict(name, [world.reference])
    value, low, high = (float(part[0]) for part in (p.value, p.low, p.high))
    return Need(value, low, high) if np.isfinite((value, low, high)).all() and value > 0 else None

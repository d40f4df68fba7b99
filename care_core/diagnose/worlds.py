"""Run and profile -> the world to ask: this run's configuration, what it met, and the configuration it is judged by."""

from __future__ import annotations

from care_core.causal.counterfactual import World
from care_core.diagnose.judging import Judged
from care_core.diagnose.ranking import reference_config
from care_core.profile.schema import Schema
from care_core.profile.store import Profile
from care_core.run import Run, is_known


def reference_of(run: Run, profile: Profile) -> dict[str, float]:
    """The reference configuration under what this run met: a context is met, not set."""
    met = {name: value for name, value in run.context.items() if is_known(value)}
    return {**reference_config(profile.schema, profile.model), **met}


def unread_options(schema: Schema, run: Run) -> frozenset[str]:
    """Options that only modes read which this run never entered; none where the log does not say."""
    if not run.modes:
        return frozenset()
    entered = {mode.casefold() for mode in run.modes}
    return frozenset(
        option.name
        for option in schema.options
        if option.modes and not entered & {mode.casefold() for mode in option.modes}
    )


def world_of(judged: Judged, profile: Profile) -> World:
    """This run, ready to be asked. Options that no source holds are taken to be at their reference, and so are those
    that were never read: their value changed nothing."""
    run = judged.run
    reference = reference_of(run, profile)
    unread = unread_options(profile.schema, run)
    config = {**reference, **{name: value for name, value in run.config.items() if name not in unread}}
    others = [{**other.run.metrics, **other.run.objectives} for other in judged.repeats]
    return World(profile.model, config, {**run.metrics, **run.objectives}, judged.bounds, others)

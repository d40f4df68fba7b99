"""Judged run and profile -> the world to ask: this run's configuration, and what it met."""

from __future__ import annotations

from care_core.causal.counterfactual import World
from care_core.diagnose.judging import Judged
from care_core.profile.schema import Schema
from care_core.profile.store import Profile
from care_core.run import Run


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
    reference = judged.reference.config
    unread = unread_options(profile.schema, run)
    config = {**reference, **{name: value for name, value in run.config.items() if name not in unread}}
    others = [{**other.run.metrics, **other.run.objectives} for other in judged.repeats]
    return World(profile.model, config, {**run.metrics, **run.objectives}, judged.bounds, others)

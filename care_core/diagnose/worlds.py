"""Run and profile -> the world to ask: this run's configuration, what it met, and the configuration it is judged by."""

from __future__ import annotations

from care_core.causal.counterfactual import World
from care_core.diagnose.judging import Judged
from care_core.diagnose.ranking import reference_config
from care_core.profile.store import Profile
from care_core.run import Run, is_known


def reference_of(run: Run, profile: Profile) -> dict[str, float]:
    """The reference configuration under what this run met: a context is met, not set."""
    met = {name: value for name, value in run.context.items() if is_known(value)}
    return {**reference_config(profile.schema, profile.model), **met}


def world_of(judged: Judged, profile: Profile) -> World:
    """This run, ready to be asked; options that no source holds are taken to be at their reference."""
    run = judged.run
    config = {**reference_of(run, profile), **run.config}
    return World(profile.model, config, {**run.metrics, **run.objectives}, judged.bounds)

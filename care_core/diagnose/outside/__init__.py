"""Suspects among the parameters that the profile does not model: all that the log holds.

What is off (`off`), how the run shows that it failed (`signs`), what the causal map and the screening flights say of
each (`suspects`), and what is advised of it (`change`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from care_core.causal.counterfactual import CounterfactualQuery
from care_core.configs.driven import readable
from care_core.diagnose.outside.off import off_parameters
from care_core.diagnose.outside.signs import signs_of
from care_core.diagnose.outside.suspects import outside_suspects, phases_of
from care_core.diagnose.records import ObjectiveResult, OutsideSuspect
from care_core.ecosystems.findings import Health
from care_core.ecosystems.vehicles import vehicle_of_run
from care_core.logs.formats import format_named
from care_core.profile.schema import Schema
from care_core.run import Run, Setting


def suspects_outside(
    run: Run,
    broken: Sequence[ObjectiveResult],
    health: Health,
    schema: Schema | None = None,
    query: CounterfactualQuery | None = None,
    good: Mapping[str, Setting] | None = None,
) -> tuple[OutsideSuspect, ...]:
    """The parameters that no option of the profile sets and that may have lost this run, the likeliest first.

    Args:
        broken: the objectives that it missed.
        query: what its configuration is expected to do, by the profile `schema`; None where no model can be asked.
        good: the parameters of the last good run, None where none is known.
    """
    if not _is_mapped(run):
        return ()
    vehicle = vehicle_of_run(run)
    modelled = {name for option in schema.options for name in readable(option)} if schema is not None else set()
    off = [one for one in off_parameters(run.settings, vehicle, modelled, good) if one.name not in health.shown_right]
    if not off:
        return ()
    begins = "armed" if vehicle.kind == "rover" else "took off"
    has_begun = any(event.text.startswith(begins) for event in health.timeline)
    signs = signs_of(run, broken, health, schema, query)
    return outside_suspects(off, signs, phases_of(run, has_begun), vehicle.kind)


def _is_mapped(run: Run) -> bool:
    """Whether the causal map has parameters of such a robot: ArduPilot's vehicles and PX4's multicopters."""
    ecosystem = format_named(run.log.format).ecosystem
    return ecosystem == "ardupilot" or (ecosystem == "px4" and run.log.facts.get("vehicle") == "multicopter")

"""Runs of different missions made comparable: each value over what physics says the reference configuration needs.

A mission of 800 m takes longer than one of 300 m, which hides what an option costs. The graph search, and all that asks
how bad a run was, look at the ratio. Mechanisms do not: they take the nominal of the run's own configuration.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from care_core.numbers import Bools, Floats
from care_core.profile.schema import Schema
from care_core.records import replace
from care_core.variables import Role, Variable

ENOUGH_PARTS = 10
"""Thirty runs of three missions let a regression learn the missions by heart: energies were off by 20%, not by 5%."""


def relative(frame: pd.DataFrame, schema: Schema) -> pd.DataFrame:
    """The schema's variables, each that has a nominal divided by it, all options at their reference."""
    ratios = {}
    for name in schema.variables:
        nominal = schema.nominal_of(name)
        if nominal is not None:
            columns = np.column_stack([_at_reference(frame, schema, argument) for argument in nominal.inputs])
            ratios[name] = frame[name].to_numpy(dtype=float) / nominal.of(columns)
    compared: pd.DataFrame = frame[[name for name in schema.variables if name in frame]].assign(**ratios)
    return compared


def needs(objective: Variable, frame: pd.DataFrame, schema: Schema) -> Floats:
    """What the reference configuration needs for the mission of each run, shape (n,).

    It is what runs of the same mission with every option at its reference took; where there is none, the nominal
    corrected by what all such runs took, or their median.
    """
    ratio = relative(frame, schema)[objective.name].to_numpy(dtype=float)
    values = frame[objective.name].to_numpy(dtype=float)
    at_reference = is_reference(frame, schema) & np.isfinite(values)
    typical = float(np.median(ratio[at_reference])) if at_reference.any() else np.nan
    need = np.asarray(typical * values / ratio) if objective.nominal else np.full(len(frame), typical)
    missions = missions_of(frame, schema)
    for mission in () if missions is None else np.unique(missions[at_reference]):
        same = missions == mission
        need[same] = np.median(values[same & at_reference])
    return need


def missions_of(frame: pd.DataFrame, schema: Schema) -> NDArray[np.int64] | None:
    """A number for each run, the same for runs of which the same was asked, shape (n,); None where nothing tells, or
    where all that tell were asked the same. A run that does not tell, one that never began, has a number of its own."""
    names = [context.name for context in schema.asked]
    if not names:
        return None
    rounded = frame[names].to_numpy(dtype=float).round(1)
    told = np.isfinite(rounded).any(axis=1)
    if len(np.unique(rounded[told], axis=0)) < 2:
        return None
    return np.asarray(np.unique(rounded, axis=0, return_inverse=True)[1].ravel(), dtype=np.int64)


def configurations_of(frame: pd.DataFrame, schema: Schema) -> NDArray[np.int64]:
    """A number for each run, the same for runs of one configuration on one mission, shape (n,). What was asked is told
    apart as by `missions_of`: a robot never starts from quite the same place."""
    asked = [context.name for context in schema.asked]
    options = [option.name for option in schema.options if option.name in frame]
    columns = [*frame[options].to_numpy(dtype=float).T, *frame[asked].round(1).to_numpy(dtype=float).T]
    numbers = np.zeros(len(frame), dtype=np.int64)
    for column in columns:
        if numbers.max(initial=0) + 1 == len(numbers):  # each run is its own already
            break
        codes, values = pd.factorize(column, use_na_sentinel=False)
        numbers = pd.factorize(numbers * len(values) + codes)[0]
    return numbers


def left_out_together(frame: pd.DataFrame, schema: Schema) -> NDArray[np.int64]:
    """A number for each run, shape (n,): those of one number are left out together where errors are measured.

    They are the runs of one mission where missions enough differ, for the model will be asked about others; else those
    of one configuration, which vouch for each other; else each run alone. A part that holds nearly all runs is no test:
    without it nothing is known, and what nothing is known of is never far off. So parts are counted by their weight
    (inverse Simpson index).
    """
    for parts in (missions_of(frame, schema), configurations_of(frame, schema)):
        if parts is not None and _count(parts) >= ENOUGH_PARTS:
            return parts
    return np.arange(len(frame))


def _count(parts: NDArray[np.int64]) -> float:
    """How many parts of equal size say as much as these."""
    sizes = np.unique(parts, return_counts=True)[1].astype(float)
    return float(sizes.sum() ** 2 / (sizes**2).sum()) if len(sizes) else 0.0


def is_reference(frame: pd.DataFrame, schema: Schema) -> Bools:
    """Which runs were made with every option at its reference; shape (n,)."""
    at = np.ones(len(frame), dtype=bool)
    for option in schema.options:
        if option.default is not None:
            at &= np.isclose(frame[option.name].to_numpy(dtype=float), option.default, rtol=1e-4)
    return at


def of_ratios(schema: Schema) -> Schema:
    """The schema of a table that `relative` has made: nothing is left to divide by."""
    return replace(schema, variables={name: replace(v, nominal=None) for name, v in schema.variables.items()})


def _at_reference(frame: pd.DataFrame, schema: Schema, name: str) -> Floats:
    """An option's reference in every run, or the context that the run met; shape (n,)."""
    variable, values = schema.variables[name], frame[name].to_numpy(dtype=float)
    if variable.role is Role.OPTION:
        return np.full(len(frame), float(np.median(values)) if variable.default is None else variable.default)
    return values

"""The frame: formulas by their names, and the one that a profile names with its arguments found."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from care_core.geodesy import GRAVITY
from care_core.numbers import Floats
from care_core.records import Record

Given = Mapping[str, Floats]
"""Arguments of a formula by their names, each of shape (n,)."""

SCALES = {"cm": 0.01, "cm/s": 0.01, "cm/s/s": 0.01, "cdeg": 0.01, "ms": 0.001, "gravities": GRAVITY}
"""From a variable's unit to that of a formula's argument."""
TINY = 1e-6


class Formula(Record):
    """A formula and the names of its arguments."""

    arguments: tuple[str, ...]
    compute: Callable[[Given], Floats]


FORMULAS: dict[str, Formula] = {}


class Nominal(Record):
    """A formula with the variables that are its arguments. `inputs` and `scales` follow the formula's arguments."""

    kind: str
    inputs: tuple[str, ...]
    scales: tuple[float, ...]

    def of(self, columns: Floats) -> Floats:
        """The nominal value of each run, above 0. columns: shape (n, len(inputs)) in the variables' own units."""
        formula = FORMULAS[self.kind]
        scaled = columns * np.array(self.scales)
        given = dict(zip(formula.arguments, scaled.T, strict=True))
        with np.errstate(all="ignore"):  # a value out of range gives a nominal that nobody believes, not a warning
            value = formula.compute(given)
        return np.asarray(np.maximum(value, TINY))


def nominal(kind: str, given: Mapping[str, str], units: Mapping[str, str]) -> Nominal:
    """The formula with its arguments found: the variable that is given for it, else the one of its own name.

    Args:
        given: argument -> variable. units: unit of each variable of the profile.

    Raises:
        ValueError: no such formula, an argument that it lacks, or a variable that is not there.
    """
    if kind not in FORMULAS:
        raise ValueError(f"there is no formula '{kind}'; known are {', '.join(FORMULAS)}")
    names = FORMULAS[kind].arguments
    for name in given:
        if name not in names:
            raise ValueError(f"'{kind}' has no argument '{name}'; it has {', '.join(names)}")
    inputs = tuple(given.get(name, name) for name in names)
    for name in inputs:
        if name not in units:
            raise ValueError(f"'{kind}' needs '{name}', which the profile does not declare")
    return Nominal(kind, inputs, tuple(SCALES.get(units[name], 1.0) for name in inputs))


def formula(*arguments: str) -> Callable[[Callable[[Given], Floats]], Callable[[Given], Floats]]:
    """Register a function under its own name."""

    def register(compute: Callable[[Given], Floats]) -> Callable[[Given], Floats]:
        FORMULAS[compute.__name__] = Formula(arguments, compute)
        return compute

    return register

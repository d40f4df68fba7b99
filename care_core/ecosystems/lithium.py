"""A cell of a lithium polymer pack in volts: what its chemistry gives, and the levels that ArduPilot's page on the
battery's failsafe advises. Where a limit of a check is such a figure, it is this one."""

from __future__ import annotations

import numpy as np

FULL_V, HIGHEST_V = 4.2, 4.25
"""At rest and fully charged: what it has, and the most that a monitor reads."""
NO_CELL_V = 4.4
"""More than any cell has: those of high voltage are full at 4.35 V."""
CHARGED_V = 4.1
"""At rest, of a pack that was charged and has given little since."""
NOT_FULL_V = 3.9
"""At rest: below it a cell is far from full."""
LOW_V, CRITICAL_V = 3.5, 3.3
"""What is advised for BATT_LOW_VOLT and BATT_CRT_VOLT. A cell that rests at the low level is about empty."""
HARMED_V = 3.0
"""A cell that is drawn below it is damaged; none rests there."""
RUNS_V = 4.0
"""One cell that is about full: no vehicle runs on less."""

_REST_V = (3.3, 3.6, 3.7, 3.75, 3.8, 3.85, 3.9, 4.0, 4.1, 4.2)
_CHARGE = (0.0, 0.05, 0.13, 0.25, 0.4, 0.55, 0.63, 0.78, 0.89, 1.0)


def charge_left(volts: float) -> float:
    """The share of its charge that a cell holds which rests at a voltage, by the usual discharge curve."""
    return float(np.interp(volts, _REST_V, _CHARGE))

"""A battery of a vehicle: its cells, its voltage at rest, and how it began."""

from __future__ import annotations

import math

import numpy as np

from care_core.ecosystems.ardupilot.armed import Armed
from care_core.ecosystems.ardupilot.statistics import smooth
from care_core.ecosystems.lithium import FULL_V, HARMED_V, HIGHEST_V, LOW_V, RUNS_V
from care_core.ecosystems.spans import during
from care_core.logs.base import Table
from care_core.numbers import median, quantile
from care_core.records import Record

_PACKS = (1, 2, 3, 4, 5, 6, 8, 10, 12, 14)
_MOST_V = 120.0
_STEADY_S = 2.0
"""Over so long a voltage is that of the pack, and no longer the noise of a monitor, which may be a cell's."""
_FULL_PACK = ("MOT_BAT_VOLT_MAX", "MOT_V_MAX", "Q_M_BAT_VOLT_MAX")
"""Parameters of the voltage of a full pack, which the motors' output is scaled by."""


class Battery(Record, eq=False):
    """One battery. Voltages are in V."""

    number: int
    table: Table
    """BAT where its voltage is a number."""
    start_s: float
    """The first arming, else the first record."""
    start_v: float
    """What it then had."""
    rest_v: float | None
    """Median before the motors draw anything: until they lift, or all of a log that never flew."""
    cells: int
    """In series: as the parameters for a full pack say, else the fewest that can give its voltage."""
    are_cells_known: bool
    """Whether a parameter says how many, or no other number could have its voltage at the start."""

    @classmethod
    def of(cls, flight: Armed, number: int, recorded: Table) -> Battery:
        """The battery of an instance of BAT."""
        table = recorded.where(np.isfinite(recorded["Volt"]) & np.isfinite(recorded.t))
        alive = within_reason(table)
        start_s, start_v = _start(flight, table)
        full = flight.setting(*_FULL_PACK) if number == 1 else None
        highest = quantile(smooth(alive.t, alive["Volt"], _STEADY_S), 0.99) if len(alive) else 0.0
        fewest = max(math.ceil((highest - 0.3) / HIGHEST_V), 1)
        by_parameter = round(full / FULL_V) if full else 0
        # A pack whose best moment is below what harms its cells has fewer than the parameter says.
        is_by_parameter = by_parameter >= fewest and highest / max(by_parameter, 1) >= HARMED_V
        cells = by_parameter if is_by_parameter else fewest
        known = is_by_parameter or _possible(start_v) == [cells]
        return cls(number, table, start_s, start_v, _at_rest(flight, alive), cells, known)

    @property
    def name(self) -> str:
        return f"battery {self.number}" if self.number > 1 else "battery"


def within_reason(table: Table) -> Table:
    """The rows of BAT with a voltage that a vehicle could run on."""
    return table.where((table["Volt"] > RUNS_V) & (table["Volt"] < _MOST_V))


def _possible(volts: float) -> list[int]:
    """The numbers of cells that a pack of such a voltage at rest may have."""
    return [count for count in _PACKS if LOW_V <= volts / count <= HIGHEST_V]


def _start(flight: Armed, table: Table) -> tuple[float, float]:
    if not len(table):
        return math.nan, math.nan
    start = flight.armed[0][0] if flight.armed else float(table.t[0])
    before = table.between(-np.inf, start)
    return (start, float(before["Volt"][-1])) if len(before) else (float(table.t[0]), float(table["Volt"][0]))


def _at_rest(flight: Armed, table: Table) -> float | None:
    until = flight.armed[0][0] + 1.0 if flight.armed else flight.end_s
    if (driven := flight.throttle) is not None:
        at, throttle = driven
        lifting = at[(throttle > 0.05) & during(flight.armed, at)]
        until = float(lifting[0]) if len(lifting) else until
    before = table["Volt"][table.t <= until]
    return float(median(before[-50:])) if len(before) >= 2 else None

"""A battery that was not charged, one whose voltage falls under load as no sound one's does, one that ran down, one
that was told to be empty and was not, and one that has fewer or more cells than are set."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import UNCHARGED, Finding
from care_core.ecosystems.lithium import HARMED_V, HIGHEST_V, LOW_V, NO_CELL_V
from care_core.ecosystems.px4.flight import FLAGS, Px4Flight
from care_core.ecosystems.spans import Span
from care_core.ecosystems.vehicles.settings import code
from care_core.logs.base import Table, Wanted
from care_core.numbers import median
from care_core.text import listed

_TOPIC = "battery_status"
READS: Wanted = {_TOPIC: ("voltage_v", "current_a", "remaining", "warning"), FLAGS: ("battery_low_remaining_time",)}
LIMITS = Limits()
_CHARGED = LIMITS.add("charge at arming", 0.5, "of the battery", "a choice: a mission is planned with a full one")
_DRAINED = LIMITS.add(
    "the same, of a log that begins armed", 0.15, "of the battery", "BAT_LOW_THR: it warns from there"
)
_WORN_MOHM = LIMITS.add("resistance of a cell", 30.0, "mOhm", "sound lithium cells have 2 to 10; old ones 20")
_LEAST_A = LIMITS.add("current from which it is told", 3.0, "A", "a choice: below it the voltage hardly falls")
_LOADED_S = LIMITS.add("time after arming in which it is told", 20.0, "s", "a choice: the charge is still the same")
_LOADED = LIMITS.add("current under load", 0.5, "of the most then", "a choice: motors that idle draw less")
_EMPTY_P = LIMITS.add(
    "probability that it was not charged", 0.9, "", "training flights: 6 of 6, and none of 460 without"
)
_WORN_P = LIMITS.add("probability that it is worn", 0.85, "", "training flights: 3 of 3, and none of 460 without")
_LOSES_P = LIMITS.add("probability that a mission fails with either", 0.9, "", "training flights: 9 of 9")
_RAN_S = LIMITS.add("time in the air at its emergency level", 1.0, "s", "a choice: a gust draws it down for less")
_DEEP_V = LIMITS.add("voltage of a cell in the air that is emptied", HARMED_V, "V", "lithium cells are damaged below")
_RAN_P = LIMITS.add("probability that it ran down", 0.9, "", "the firmware's own word")
_RAN_LOSES_P = LIMITS.add(
    "probability that a mission fails as it runs down", 0.7, "", "a choice: it may have come home"
)
_SHORT_V = LIMITS.add("voltage of a cell at rest that is none", 3.1, "V", "nobody takes off with cells as dead as that")
_PER_CELL = (LIMITS.add("least voltage of a cell that is", LOW_V, "V", "an empty lithium cell at rest"),
             LIMITS.add("most voltage of a cell that is", HIGHEST_V, "V", "a full one: 4.2"))  # fmt: skip
_CELLS_P = LIMITS.add("probability of a wrong number of cells", 0.7, "", "a choice: they may all be dead")
_CELLS_LOSE_P = LIMITS.add("probability that it loses a mission", 0.05, "", "a choice: failsafes act too soon or late")
_BEGINS_S = LIMITS.add("time in which a log that begins armed tells of rest", 5.0, "s", "a choice: before it lifts")
_HALF_V = LIMITS.add(
    "voltage of a cell at rest that is half full", 3.8, "V", "discharge curves of lithium polymer cells"
)
_LOADED_V = LIMITS.add("voltage of a cell under load that is sound", 3.5, "V", "BAT1_V_EMPTY as shipped before 1.14")
_TOLD_LOW_P = LIMITS.add("probability that its charge was told too low", 0.9, "", "its voltage at rest says so")
_NEVER_DRAWN = LIMITS.add("ratio of a mean current to the most that was drawn", 3.0, "", "a choice: no gust draws that")
_MEAN_A, _NOT_LAST = "BAT_AVRG_CURRENT", "battery_low_remaining_time"
_EMPTY = "low battery"
"""What a complaint says of it."""
_CRITICAL, _EMERGENCY = 2, 3
"""battery_status.warning."""
_EMPTY_AT, _FULL_AT = ("BAT1_V_EMPTY", "BAT_V_EMPTY"), ("BAT1_V_CHARGED", "BAT_V_CHARGED")
_CELLS_SET = ("BAT1_N_CELLS", "BAT_N_CELLS")
_FEWEST, _FEWEST_AT_REST, _MOST = 3, 2, 17
"""Records that tell of a load, and of a voltage at rest (a vehicle that shuts itself down leaves no more), and one cell
more than BAT1_N_CELLS may be."""


def find(flight: Px4Flight) -> Iterator[Finding]:
    table = flight.table(_TOPIC, "voltage_v", "current_a", "remaining")
    if table is None:
        return
    causes = (
        *_other_cells(flight, table),
        *_no_levels(flight, table),
        *_told_low(flight),
        *_reckoned(flight, table),
    )
    wrong = next(iter(causes), None)
    yield from (wrong,) if wrong is not None else _ran_down(flight)
    if not flight.arming:
        return
    armed_s, end_s = flight.armed[0] if flight.armed else (flight.end_s, flight.end_s)
    if flight.arming[0][1]:  # most logs begin as it is armed: its motors idle, and it draws next to nothing
        yield from _not_charged(_at_rest(table), armed_s, _CHARGED if _was_warned(flight) else _DRAINED)
        return
    before = table.between(table.t[0], armed_s)
    if len(before) < _FEWEST:
        return
    if flight.armed or flight.was_denied:
        yield from _not_charged(before, float(before.t[0]) if not flight.armed else armed_s, _CHARGED)
    soon = table.between(armed_s, min(armed_s + _LOADED_S, end_s))
    if len(soon):
        loaded = soon.where(soon["current_a"] > _LOADED * float(soon["current_a"].max()))
        yield from _worn(before, loaded, code(flight.log.settings(), "BAT1_N_CELLS") or 0, (armed_s, end_s))


def _other_cells(flight: Px4Flight, table: Table) -> Iterator[Finding]:
    """By its voltage at rest, which no pack of so many cells has that is still flown, or none at all."""
    name, cells = _cells_set(flight)
    rest = _at_rest(table)
    if not cells or len(rest) < _FEWEST_AT_REST:
        return
    volts = float(median(rest["voltage_v"]))
    fits = [n for n in range(1, _MOST) if _PER_CELL[0] <= volts / n <= _PER_CELL[1]]
    fewer, more = [n for n in fits if n < cells], [n for n in fits if n > cells]
    if volts / cells < _SHORT_V and len(fewer) == 1:
        has, wanted = f"{volts / fewer[0]:.1f} V for each of {fewer[0]}; levels, charge and", fewer[0]
    elif volts / cells > NO_CELL_V and more:
        has, wanted = (
            f"more than any has, {volts / more[0]:.1f} V for each of {more[0]}; it never looks low, and",
            more[0],
        )
    else:
        return
    is_held = wanted < cells and _is_held_for_empty(flight)
    yield Finding(
        kind="battery",
        title=f"the battery has {'fewer' if wanted < cells else 'more'} cells than are set",
        onset_s=float(rest.t[0]),
        end_s=float(rest.t[-1]),
        severity="critical" if is_held else "warning",
        evidence=(
            f"{volts:.1f} V at rest: {volts / cells:.1f} V for each of the {cells} cells that {name} tells, "
            f"{has} failsafes are wrong with it"
        ),
        source=f"{_TOPIC}.voltage_v; {name}",
        suspect="parameter",
        probability=_TOLD_LOW_P if is_held else _CELLS_P,
        mission_lost=_LOSES_P if is_held else _CELLS_LOSE_P,
        parameters=(name,),
        wanted=((name, float(wanted)),) if wanted < cells or len(more) == 1 else (),
    )


def _at_rest(table: Table) -> Table:
    """The first records, in which it draws next to nothing."""
    return table.where((table["current_a"] < _LEAST_A) & (table.t <= table.t[0] + _BEGINS_S))


def _cells_set(flight: Px4Flight) -> tuple[str, int]:
    """The parameter that tells how many cells there are, and how many it tells; none where no parameter does."""
    told = ((name, code(flight.log.settings(), name)) for name in _CELLS_SET)
    return next(((name, cells) for name, cells in told if cells), ("", 0))


def _no_levels(flight: Px4Flight, table: Table) -> Iterator[Finding]:
    """By the voltages of an empty and a full cell, between which no cell has its charge, where the vehicle holds a
    sound battery for empty with them."""
    (_, cells), rest = _cells_set(flight), _at_rest(table)
    if not cells or not _is_held_for_empty(flight) or len(rest) < _FEWEST_AT_REST:
        return
    volts = float(median(rest["voltage_v"])) / cells
    (empty, empty_v), (full, full_v) = (_level(flight, names) for names in (_EMPTY_AT, _FULL_AT))
    wrong = [name for name, is_off in ((empty, empty_v > _HALF_V), (full, full_v > NO_CELL_V)) if name and is_off]
    if wrong and volts > _HALF_V:
        yield Finding(
            kind="battery",
            title="the battery is told to be empty, and is not",
            onset_s=float(rest.t[0]),
            end_s=float(rest.t[-1]),
            severity="critical",
            evidence=(
                f"{volts:.2f} V a cell at rest, more than half full; "
                + listed([f"{one} is {flight.parameter(one):g} V" for one in wrong])
                + ", where no cell is empty or full"
            ),
            source=f"{_TOPIC}.voltage_v, remaining; {', '.join(wrong)}",
            suspect="parameter",
            probability=_TOLD_LOW_P,
            mission_lost=_LOSES_P,
            parameters=tuple(wrong),
            wanted=tuple(
                (name, float(one.default))
                for name in wrong
                if (one := flight.off_default(name)) is not None and isinstance(one.default, (int, float))
            ),
        )


def _is_held_for_empty(flight: Px4Flight) -> bool:
    """Whether a preflight check kept it from arming for its charge."""
    return not flight.armed and any(_EMPTY in text.lower() for _, text in flight.complaints)


def _level(flight: Px4Flight, names: tuple[str, ...]) -> tuple[str, float]:
    """The parameter of a level of a cell and its voltage; not a number where none tells."""
    told = ((name, flight.parameter(name)) for name in names)
    return next(((name, volts) for name, volts in told if volts is not None), ("", np.nan))


def _told_low(flight: Px4Flight) -> Iterator[Finding]:
    """By its voltage at rest, once disarmed, where it was all but empty in the air by what the firmware told."""
    table, (_, cells) = flight.table(_TOPIC, "voltage_v", "current_a", "warning"), _cells_set(flight)
    if table is None or not cells or not flight.aloft:
        return
    begin, end = flight.aloft[0][0], flight.aloft[-1][1]
    warned = table.t[(table["warning"] >= _CRITICAL) & (table.t >= begin) & (table.t <= end)]
    rest = table.where((table.t >= flight.armed[-1][1]) & (table["current_a"] < _LEAST_A))
    if not len(warned) or len(rest) < _FEWEST:
        return
    flown = table.between(begin, end)
    rest_v, least_v = float(median(rest["voltage_v"])) / cells, float(np.min(flown["voltage_v"])) / cells
    if rest_v <= _HALF_V or least_v < _LOADED_V:
        return
    name = next((one for one in _EMPTY_AT if one in flight.log.settings()), "")
    yield Finding(
        kind="battery",
        title="the battery was told to be empty, and was not",
        onset_s=float(warned[0]),
        end_s=end,
        severity="critical",
        evidence=(
            f"{least_v:.2f} V a cell at the least in the air, {rest_v:.2f} V at rest once disarmed: more than half full"
            + (f"; {name} is {flight.log.settings()[name][-1].value:g} V a cell" if name else "")
            + ("" if float(np.max(flown["current_a"])) > _LEAST_A else ", and no current tells what the load takes")
        ),
        source=f"{_TOPIC}.voltage_v, current_a, warning; {name}",
        suspect="parameter",
        probability=_TOLD_LOW_P,
        parameters=(name,) if name else (),
    )


def _reckoned(flight: Px4Flight, table: Table) -> Iterator[Finding]:
    """A battery that was not to last, by a mean current that was set and was never drawn."""
    setting = flight.off_default(_MEAN_A)
    for span in flight.armed if setting is not None else ():
        short_s = flight.first_s(FLAGS, _NOT_LAST, 1, span)
        set_a, drawn_a = flight.parameter(_MEAN_A), float(np.max(table.between(*span)["current_a"], initial=_LEAST_A))
        if short_s is not None and set_a is not None and set_a > _NEVER_DRAWN * drawn_a:
            yield Finding(
                kind="battery",
                title="how long its battery lasts is reckoned with a current that it never drew",
                onset_s=short_s,
                end_s=span[1],
                severity="critical",
                evidence=f"{_MEAN_A} is {set_a:g} A, and the most that was drawn {drawn_a:.0f} A",
                source=f"{FLAGS}.{_NOT_LAST}, {_TOPIC}.current_a",
                suspect="parameter",
                probability=_TOLD_LOW_P,
                parameters=(_MEAN_A,),
            )
            return


def _ran_down(flight: Px4Flight) -> Iterator[Finding]:
    """By the firmware's own level of it, in the air."""
    table = flight.table(_TOPIC, "voltage_v", "current_a", "warning")
    if table is None:
        return
    _, cells = _cells_set(flight)
    for span in flight.aloft:
        flown = table.between(*span)
        empty = flown["warning"] == _EMERGENCY
        if len(flown) < _FEWEST or float(np.sum(np.diff(flown.t)[empty[:-1]])) < _RAN_S:
            continue
        low = int(np.argmin(flown["voltage_v"]))
        volts = float(flown["voltage_v"][low])
        deep = cells > 0 and float(np.sum(np.diff(flown.t)[(flown["voltage_v"] < _DEEP_V * cells)[:-1]])) >= _RAN_S
        a_cell = f", {volts / cells:.2f} V a cell" if cells else ""
        yield Finding(
            kind="battery",
            title="the battery ran down to its emergency level",
            onset_s=float(flown.t[empty][0]),
            end_s=span[1],
            severity="critical" if deep else "warning",
            evidence=f"{volts:.1f} V at {float(flown['current_a'][low]):.0f} A at the least{a_cell}, in the air",
            source=f"{_TOPIC}.warning, voltage_v",
            probability=_RAN_P,
            mission_lost=_RAN_LOSES_P,
        )
        return


def _was_warned(flight: Px4Flight) -> bool:
    """Whether the firmware found its charge low while it was armed."""
    table = flight.table(_TOPIC, "warning")
    return table is not None and any(bool(np.any(table.between(*span)["warning"] > 0)) for span in flight.armed)


def _not_charged(before: Table, armed_s: float, least: float) -> Iterator[Finding]:
    """By the firmware's own estimate of the charge."""
    told = before["remaining"][before["remaining"] > 0.0]  # none at all is what an estimate knows that has not begun
    charge = float(told[-1]) if len(told) else 1.0
    if charge < least:
        yield Finding(
            kind="battery",
            title=UNCHARGED,
            onset_s=armed_s,
            end_s=armed_s,
            severity="critical",
            evidence=f"it was to fly with {charge:.0%} of its charge, at {float(before['voltage_v'][-1]):.1f} V",
            source=f"{_TOPIC}.remaining",
            probability=_EMPTY_P,
            mission_lost=_LOSES_P,
        )


def _worn(before: Table, loaded: Table, cells: int, span: Span) -> Iterator[Finding]:
    """By the fall of its voltage as the motors spin up, a cell and an ampere."""
    if cells < 1 or len(loaded) < _FEWEST:
        return
    amperes = float(median(loaded["current_a"])) - float(median(before["current_a"]))
    fall_v = float(median(before["voltage_v"])) - float(median(loaded["voltage_v"]))
    if amperes < _LEAST_A or not (ohm := 1000 * fall_v / amperes / cells) > _WORN_MOHM:
        return
    yield Finding(
        kind="battery",
        title="the battery's voltage falls under load",
        onset_s=span[0],
        end_s=span[1],
        severity="critical",
        evidence=f"{fall_v:.1f} V at {amperes:.0f} A, {ohm:.0f} mOhm a cell; a sound one has 2 to 10",
        source=f"{_TOPIC}.voltage_v, current_a",
        probability=_WORN_P,
        mission_lost=_LOSES_P,
    )


CHECK = Check(
    "battery",
    "a battery that was not charged, sags under load, ran down, was told empty or has other cells than are set",
    READS,
    LIMITS,
    find,
)

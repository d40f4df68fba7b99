"""What each parameter of a vehicle does: which part it belongs to, which phase reads it, which sign answers to it.

Facts of the firmware's documentation and source, in the tables beside this module. The causal map of what no profile
learned: it turns a parameter that is off its default into a suspect, or clears it.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Literal, TypeVar, get_args

from care_core.metadata.aliases import aliases_of
from care_core.metadata.fact import expanded, lines_of
from care_core.metadata.firmware import PX4, letter_of
from care_core.records import Record

TABLE, TABLE_OF_PX4 = (Path(__file__).with_name(f"{firmware}_map.tsv") for firmware in ("ardupilot", "px4"))

Role = Literal["choice", "safety", "calibration", "wiring", "written", "idle"]
"""Who sets a parameter, and for what: an operator's choice (gains, speeds, heights); a protection (failsafes, arming
checks, fences, crash checks), which is never suggested looser; a calibration of this very vehicle; how it is built and
wired (frame, functions, directions, orientations, ports, types of devices); written by the vehicle itself; or something
that moves no vehicle (logs, lights, cameras, links, names)."""

FROM_FLIGHTS: frozenset[Role] = frozenset(("choice",))
"""Roles of what flights of other vehicles speak for, and a report may therefore set: how a vehicle is built, wired and
calibrated, and what protects it, is set by nobody but its operator."""
BUILT_AS = "frame"
"""The part whose parameters say how the vehicle is built, which its operator alone knows, whatever the default is."""
OF_THIS_VEHICLE: frozenset[Role] = frozenset(("wiring", "calibration"))
"""Roles of what is right for one vehicle alone, and off the default on every sound one."""
SET_BY_HAND: frozenset[Role] = frozenset(("choice", "wiring"))
"""Roles of what is put back by a command: what protects is looked at first, and a calibration is made again."""
NO_CAUSE: frozenset[Role] = frozenset(("written", "idle"))
"""Roles of what loses no mission: outcomes, and what moves no vehicle."""

Read = Literal[
    "always", "arming", "takeoff", "navigation", "hold", "rtl", "land", "manual", "guided", "fence", "battery",
    "radio", "gcs", "terrain", "rangefinder", "flow", "beacon", "airspeed", "never",
]  # fmt: skip
"""When the firmware reads it: in any flight; before it arms; in a phase of a mission; in modes that a pilot or a
companion flies; where a fence, a failsafe or a sensor is in use; in no flight."""

Sign = Literal[
    "refused", "no_takeoff", "tipped", "upset", "thrust", "oscillates", "strays", "heading", "position", "height",
    "estimator", "slow_takeoff", "slow_cruise", "slow_hold", "slow_rtl", "slow_land", "costly", "failsafe_battery",
    "failsafe_radio", "failsafe_gcs", "failsafe_estimator", "failsafe_fence", "failsafe_terrain", "elsewhere", "stuck",
    "loop", "vibration", "stops",
]  # fmt: skip
"""How a run shows that it failed: arming was refused, it did not rise, tipped over at take-off, lost control or
crashed, had too little thrust, swung around its target, left its path; its heading, position, height or estimate was
false; a phase took long, it drew too much, a failsafe acted, it came down elsewhere, made no progress, its main loop
was late, it shook, it disarmed or stopped by itself."""

ROLES: tuple[Role, ...] = get_args(Role)
READS: tuple[Read, ...] = get_args(Read)
SIGNS: tuple[Sign, ...] = get_args(Sign)


class Meaning(Record):
    """What the causal map says of a parameter."""

    name: str
    role: Role
    part: str
    """The subsystem that it belongs to, in a word or two: "rate control", "compass", "battery monitor"."""
    read: frozenset[Read]
    signs: frozenset[Sign]
    """How a run shows that it is wrong, where it can matter."""


_Cells = tuple[str, str, str, str]
"""Role, part, read and signs as the table has them."""


class _Map(Record):
    """The rows of one kind of vehicle."""

    names: Mapping[str, _Cells]
    families: Mapping[str, _Cells]
    """By what their names begin with."""


def meaning_of(name: str, kind: str) -> Meaning | None:
    """What a parameter does on a kind of vehicle, under any of the names that it has had: by its own row, else by the
    longest family that it belongs to. None where the map does not know it."""
    if not letter_of(kind):
        return None
    held = _map_of(TABLE_OF_PX4 if kind == PX4 else TABLE, letter_of(kind))
    names = dict.fromkeys((name, *(one.name for one in aliases_of(name, kind))))
    beginnings = (one[:length] for one in names for length in range(len(one), 0, -1))
    found = next((held.names[one] for one in names if one in held.names), None)
    found = found or next((held.families[one] for one in beginnings if one in held.families), None)
    return None if found is None else _meaning(name, found)


@cache
def _meaning(name: str, cells: _Cells) -> Meaning:
    role, part, read, signs = cells
    return Meaning(name, _words(ROLES, role)[0], part, frozenset(_words(READS, read)), frozenset(_words(SIGNS, signs)))


@cache
def _map_of(table: Path, vehicle: str) -> _Map:
    """The map of the vehicle with this letter: a row for it counts before one for all."""
    names: dict[str, _Cells] = {}
    families: dict[str, _Cells] = {}
    rows = [line.split("\t") for line in lines_of(table)[1:]]
    for pattern, vehicles, role, part, read, signs in sorted(rows, key=lambda row: row[1] != ""):
        if vehicles and vehicle not in vehicles:
            continue
        for one in expanded(pattern):
            start = one.removesuffix("*")
            (names if one == start else families)[start] = role, part, read, signs
    return _Map(names, families)


W = TypeVar("W", bound=str)


def _words(known: tuple[W, ...], text: str) -> tuple[W, ...]:
    return tuple(one for one in known if one in text.split())

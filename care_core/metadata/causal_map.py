"""What each parameter of a vehicle does: which part it belongs to, which phase reads it, which sign answers to it.

Facts of the firmware's documentation and source, in the tables beside this module. The causal map of what no profile
learned: it turns a parameter that is off its default into a suspect, or clears it.
"""

from __future__ import annotations

from typing import Literal, get_args

from care_core.records import Record

Role = Literal["choice", "safety", "calibration", "wiring", "written", "idle"]
"""Who sets a parameter, and for what: an operator's choice (gains, speeds, heights); a protection (failsafes, arming
checks, fences, crash checks), which is never suggested looser; a calibration of this very vehicle; how it is built and
wired (frame, functions, directions, orientations, ports, types of devices); written by the vehicle itself; or something
that moves no vehicle (logs, lights, cameras, links, names)."""

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
"""How a run shows that it failed: arming was refused, it did not rise, tipped over at take-off, lost control or crashed,
had too little thrust, swung around its target, left its path; its heading, position, height or estimate was false; a
phase took long, it drew too much, a failsafe acted, it came down elsewhere, made no progress, its main loop was late, it
shook, it disarmed or stopped by itself."""

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

"""A thruster of a submarine that is weak, off or reversed, by what its vehicle needs to hold still.

Thrusters are laid out in pairs, so a sound submarine holds its roll and heading with hardly any output of its rate
controllers; one that lacks a thruster turns with every push of its partner, and has to hold against that all the time.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.airborne import UPSIDE_DOWN_DEG
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.statistics import lasting, smooth
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.spans import during, seconds_in
from care_core.logs.base import Wanted
from care_core.numbers import median
from care_core.records import replace

_MANUAL = 19
"""Mode of a submarine in which the sticks drive the thrusters and nothing is held (ArduSub/mode_manual.cpp)."""
READS: Wanted = {"RATE": ("ROut", "YOut"), "ATT": ("DesRoll", "DesYaw")}

LIMITS = Limits()
_MEASURED = (
    "simulated dives with sound thrusters: 0.04 at most on either; one that failed: roll 0.48, heading 0.05 to 0.6"
)
_ROLL = LIMITS.add("output that holds the roll", 0.25, "", _MEASURED)
_HEADING = LIMITS.add("output that holds the heading", 0.07, "", _MEASURED)
_STILL_DPS = LIMITS.add("rate that is asked for while it holds still", 6.0, "deg/s", "a choice: turns take output")
_OVER_S = LIMITS.add("time over which the output is averaged", 5.0, "s", "a choice: waves and gains swing to and fro")
_LASTS_S = LIMITS.add("shortest time of holding", 8.0, "s", "a choice: a current pushes for a while")
_FAILED_P = LIMITS.add("probability of a thruster", 0.75, "", "a choice: an uneven load or a tether pulls as well")
_LOST_P = LIMITS.add("probability that it costs the mission", 0.5, "", "5 of 11 such dives")
_FRAME = "FRAME_CONFIG"
_USUAL_FRAMES = frozenset((1.0, 2.0))
"""Vectored, of six thrusters and of eight (AP_Motors6DOF.h): every other is one of few vehicles."""
_NOT_DETECTED = re.compile(r"Failed! Please check Thruster (\d+) and frame setup!")
"""What motor detection says of a thruster that turns the vehicle neither way as its frame would (ArduSub:
mode_motordetect.cpp)."""


def find(flight: Flight) -> Iterator[Finding]:
    """A thruster that is fought against, and one that motor detection could not make out."""
    yield from _undetected(flight)
    yield from _fought(flight)


def _undetected(flight: Flight) -> Iterator[Finding]:
    said = [(t, match) for t, text in flight.messages if (match := _NOT_DETECTED.match(text))]
    for t, match in said[:1]:
        yield Finding(
            kind="motor",
            title=f"motor detection fails at thruster {match[1]}",
            onset_s=t,
            end_s=said[-1][0],
            severity="warning",
            evidence="it turns the vehicle neither way as its place in the frame would (check wiring, direction "
            f"and FRAME_CONFIG); the firmware says: {match[0]}",
            source="MSG",
            probability=_FAILED_P,
            mission_lost=_LOST_P,
        )


def _fought(flight: Flight) -> Iterator[Finding]:
    """The axis that needs the most; a thruster that lifts shows in the roll, one that pushes in the heading."""
    table, asked = flight.one("RATE", "ROut", "YOut"), flight.one("ATT", "DesRoll", "DesYaw")
    if flight.kind != "sub" or table is None or asked is None or len(asked) < 3:
        return
    t = table.t
    steered = flight.modes_at(t) != _MANUAL
    if (tilt := flight.tilt) is not None:
        steered &= np.interp(t, *tilt) < UPSIDE_DOWN_DEG  # what lies on its back fights to turn, not to hold still
    found = []
    for axis, named, limit in (("Roll", "roll", _ROLL), ("Yaw", "heading", _HEADING)):
        held = smooth(t, table[f"{axis[0]}Out"], _OVER_S)
        turns = np.gradient(np.degrees(np.unwrap(np.radians(asked[f"Des{axis}"]))), asked.t)
        still = np.interp(t, asked.t, np.abs(smooth(asked.t, turns, _OVER_S))) < _STILL_DPS
        spans = lasting(t, (np.abs(held) > limit) & still & steered & during(flight.watched, t), _LASTS_S, gap_s=4.0)
        if spans:
            took = float(median(np.abs(held)[during(spans, t)]))
            found.append((took / limit, named, took, limit, spans))
    if not found:
        return
    _, named, took, limit, spans = max(found)
    fought = Finding(
        kind="motor",
        title=f"a thruster is weak, off or reversed: it fights to hold its {named}",
        onset_s=spans[0][0],
        end_s=spans[-1][1],
        severity="warning",
        evidence=(
            f"{100 * took:.0f}% of its control of the {named} for {seconds_in(spans):.0f} s, with no turn "
            f"asked for (limit {100 * limit:.0f}%)"
        ),
        source="RATE.ROut, YOut; ATT.DesRoll, DesYaw",
        probability=_FAILED_P,
        mission_lost=_LOST_P,
    )
    yield _with_frame(flight, fought)


def _with_frame(flight: Flight, found: Finding) -> Finding:
    """What looks the same: thrusters that are mixed for another frame than the one that is built."""
    default, frame = flight.default_left(_FRAME), flight.setting(_FRAME)
    if default is None or frame is None:
        return found
    set_to = f"{_FRAME} is {frame:g} (default {default:g})"
    told = replace(found, evidence=f"{found.evidence}; or another frame is set than is built: {set_to}")
    return told if frame in _USUAL_FRAMES else replace(told, suspect="parameter", parameters=(_FRAME,))


CHECK = Check("thruster", "a thruster of a submarine that is weak, off or reversed", READS, LIMITS, find)

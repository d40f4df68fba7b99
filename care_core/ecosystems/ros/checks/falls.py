"""A robot that tips over, or is held by what it hit."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.ros import falls
from care_core.ecosystems.ros.drive import Drive
from care_core.ecosystems.ros.falls import Fall
from care_core.ecosystems.ros.messages import COMMANDS, GOALS, IMU, ODOMETRY, TF, reading
from care_core.text import log_time

LIMITS = Limits()
LIMITS.add("tilt", falls.TIPPED_DEG, "deg", "no slope that wheels climb is steeper (Husky A200: 45 deg)")
LIMITS.add("time that it lies so", falls.LIES_S, "s", "a choice: a robot that rears up comes down sooner")
LIMITS.add("tilt before", falls.LEVEL_DEG, "deg", "a choice: what leans or flies is no robot that stands")
LIMITS.add("time before", falls.LEVEL_S, "s", "a choice: it must have stood")
LIMITS.add("share of that time that it stood level", falls.MOSTLY, "", "a choice: ramps and kerbs are short")
LIMITS.add("height gained for each metre of way", falls.RISES, "", "what climbs more steeply flies")
LIMITS.add("height that does not count", falls.RISES_M, "m", "drift of a height")
LIMITS.add("leap of its height", falls.LEAP_M, "m", "no kerb that a robot climbs is as high")
LIMITS.add("time of a leap", falls.LEAP_S, "s", "a fall of a metre takes half as long")
LIMITS.add("change of its height before a leap", falls.PLANAR_M, "m", "a choice: what goes up and down is no floor")
LEAPS_M = LIMITS.add("change of its height that is told", 0.1, "m", "a choice: more than a wheel that lifts")
CONTACT_S = LIMITS.add("how long before a contact belongs to it", 3.0, "s", "a choice: a robot tips within a second")
HELD_S = LIMITS.add("time that a robot is held", 5.0, "s", "as a standstill against commands")
HELD_M = LIMITS.add("way in that time", 0.3, "m", "a choice: less than any robot's length")
SLIPS_S = LIMITS.add("time in which it comes to rest after a contact", 1.0, "s", "a choice: half a metre at 0.5 m/s")


def find(drive: Drive) -> Iterator[Finding]:
    """A fall, and a contact after which the robot gets no further though it is to."""
    fall = drive.fall
    if fall is not None:
        yield _fallen(drive, fall)
    yield from _stays_after_contact(drive, np.inf if fall is None else fall.start_s - CONTACT_S)


def _fallen(drive: Drive, fall: Fall) -> Finding:
    words = [f"tilted by up to {fall.most_deg:.0f} deg from {log_time(fall.start_s)} on"]
    words += ["and so to the end" if fall.stays else f"until {log_time(fall.end_s)}"] if fall.lies else []
    if fall.rose_m > LEAPS_M:
        words.append(f"its height changes by {fall.rose_m:.1f} m")
    near = drive.contacts_s[np.abs(drive.contacts_s - fall.start_s) <= CONTACT_S]
    if len(near):
        words.append(f"a contact is told at {log_time(float(near[0]))}")
    return Finding(
        kind="crash",
        title="the robot tips over" if fall.lies else "the robot falls or is thrown up",
        onset_s=fall.start_s,
        end_s=drive.duration_s if fall.stays else fall.end_s,
        severity="critical",
        evidence=", ".join(words),
        source=fall.topic,
        suspect="world" if len(near) else "operation",
        probability=0.9,
    )


def _stays_after_contact(drive: Drive, until_s: float) -> Iterator[Finding]:
    """The first contact after which the robot gets no further, though a goal is left or it is commanded to move."""
    odometry = drive.odometry
    if odometry is None:
        return
    for at in drive.contacts_s[drive.contacts_s < until_s].tolist():
        later = odometry.t >= at + SLIPS_S
        held_s = float(odometry.t[-1]) - at - SLIPS_S
        if held_s < HELD_S or odometry.spread_m(at + SLIPS_S) > HELD_M or not later.any() or not _wants_on(drive, at):
            continue
        yield Finding(
            kind="blocked",
            title="the robot hits something and gets no further",
            onset_s=at,
            end_s=drive.duration_s,
            severity=drive.severity(at),
            evidence=f"a contact is told at {log_time(at)}; it stays within"
            f" {max(odometry.spread_m(at + SLIPS_S), 0.01):.2g} m for the {held_s:.0f} s that are left",
            source=f"topics of contacts, {odometry.topic}",
            suspect="world",
            probability=0.85,
        )
        return


def _wants_on(drive: Drive, at: float) -> bool:
    """Whether the robot was on its way: to a goal that it missed, or commanded to move for long after."""
    if drive.goals:
        return any(goal.end_s >= at for goal in drive.missed)
    motion = drive.following
    return motion is not None and int(np.count_nonzero(motion.to_move & (motion.odometry.t > at + HELD_S))) > 0


READS = reading(ODOMETRY, IMU, *TF, *COMMANDS, *GOALS)
CHECK = Check("falls", "a robot that tips over, or is held by what it hit", READS, LIMITS, find)

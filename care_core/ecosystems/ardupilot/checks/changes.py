"""Parameters that were changed in the air: those after which it was upset, and those that act on control at once."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.ecosystems import changed_in_flight
from care_core.ecosystems.ardupilot.checks import attitude, crash
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.base import Check
from care_core.ecosystems.changed_in_flight import LIMITS, Change, Upset
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.vehicles import flies, motors_of
from care_core.logs.base import Wanted, merge_needs
from care_core.run import shown

READS: Wanted = merge_needs((attitude.READS, crash.READS))

_RISKY = ("ATC_", "PSC_", "RATE_", "STB_", "INS_", "EK2_", "EK3_", "EKF_", "AHRS_", "COMPASS_", "MOT_", "FRAME",
          "SERVO", "ARMING_", "FS_", "MIXMODE", "BRD_")  # fmt: skip
_HARMS_P = LIMITS.add("probability that a change in the air harms", 0.2, "", "a choice: few changes do")
_NAMED = 5
_LEARNED = ("MOT_THST_HOVER", "COMPASS_OFS", "COMPASS_DEC", "INS_GYR", "STAT_", "_CAL", "_ID")
"""What the firmware itself writes while it flies."""
_PUT_RIGHT = frozenset(("WPNAV_ACCEL", "WPNAV_SPEED", "WPNAV_RADIUS"))
"""What the firmware sets to its default as a mode begins that needs it, where it was not above 0
(AC_WPNav::wp_and_spline_init)."""
_AUTOTUNE = range(30, 38)
"""EV records of a tune, which changes gains by itself."""


def find(flight: Flight) -> Iterator[Finding]:
    """One finding for the changes before an upset, and one for all others that act on control."""
    if flight.events(*_AUTOTUNE):
        return
    flown = flight.airborne if flight.is_copter else flight.armed
    changed = [
        one
        for one in changed_in_flight.changes(flight.settings, flown)
        if not any(word in one.name for word in _LEARNED) and not _was_put_right(one)
    ]
    if not changed:
        return
    is_lost = flight.lost_control_s is not None or flight.impact_s is not None
    motors = motors_of(flight.settings, flight.motor_outputs) if flight.is_copter else ()
    found = list(changed_in_flight.find(changed, _upsets(flight), motors, is_lost=is_lost, source="PARM"))
    yield from found
    named = {name for one in found for name in one.parameters}
    risky = [one for one in changed if one.name.startswith(_RISKY) and one.name not in named]
    yield from _noted(risky, "in the air" if flies(flight.kind) else "under way")


def _upsets(flight: Flight) -> Iterator[Upset]:
    """When it did not follow its demand, swung, was lost or hit the ground. What lies upside down from the start is not
    upset when a mode begins that minds it."""
    for left_s in flight.left_demand:
        yield Upset(left_s, "its attitude was 30 degrees off its target")
    for one in (*attitude.find(flight), *crash.find(flight)):
        if one.title != attitude.UPSIDE_DOWN:
            yield Upset(one.onset_s, one.title)


def _was_put_right(change: Change) -> bool:
    """Whether the firmware itself replaced a value that it cannot use."""
    return change.name in _PUT_RIGHT and isinstance(change.before, float | int) and change.before <= 0


def _noted(changed: list[Change], where: str) -> Iterator[Finding]:
    if changed:
        yield Finding(
            kind="tuning",
            title=f"parameters were changed {where}",
            onset_s=changed[0].time_s,
            end_s=changed[-1].time_s,
            severity="info",
            evidence=", ".join(f"{one.name}={shown(one.after)}" for one in changed[:_NAMED])
            + (", ..." if len(changed) > _NAMED else ""),
            source="PARM",
            suspect="parameter",
            probability=_HARMS_P,
        )


CHECK = Check("changes", "parameters changed in the air, above all shortly before an upset", READS, LIMITS, find)

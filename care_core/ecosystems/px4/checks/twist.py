"""Motors that turn one way and work much harder than those that turn the other way: something twists the vehicle.

Motors turn in pairs so that their drag cancels. One that stands crooked, a propeller of the wrong pitch or a bent frame
turns the vehicle, and the control holds it by the drag of one pair; what that pair spends is missing for the lift.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.px4 import motors
from care_core.ecosystems.px4.flight import Px4Flight
from care_core.ecosystems.spans import seconds_in
from care_core.ecosystems.vehicles.settings import number
from care_core.logs.base import Wanted, merge_needs
from care_core.numbers import median
from care_core.text import listed

READS: Wanted = merge_needs((motors.READS,))
LIMITS = Limits()
_APART = LIMITS.add("output of one turning direction above the other", 0.2, "of the range", "a choice: sound ones 0.05")
_SPENT = LIMITS.add("output with little left", 0.75, "of the range", "a choice: gusts and climbs take a fifth")
_FLOWN_S = LIMITS.add("shortest flight", 10.0, "s", "a choice: a take-off turns it, too")
_FEWEST = 4
_TRUE_P = LIMITS.add("probability of a part", 0.6, "", "a choice: a wrong sign of CA_ROTORn_KM looks the same")
_LOST_P = LIMITS.add("probability that it costs the mission", 0.5, "", "a choice: it flies, with little lift left")


def find(flight: Px4Flight) -> Iterator[Finding]:
    """One finding, of the middle of all the time in the air."""
    asked, settings = motors.commands(flight), flight.log.settings()
    aloft = flight.aloft
    if asked is None or not flight.hovers or seconds_in(aloft) < _FLOWN_S:
        return
    drag = [number(settings, f"CA_ROTOR{n - 1}_KM") for n in asked.numbers]
    one = [k for k, km in enumerate(drag) if km is not None and km > 0.0]
    other = [k for k, km in enumerate(drag) if km is not None and km < 0.0]
    if len(drag) < _FEWEST or len(one) != len(other) or len(one) + len(other) != len(drag):
        return
    rows = np.logical_or.reduce([(asked.t > start) & (asked.t < end) for start, end in aloft])
    if rows.sum() < _FEWEST:
        return
    share = [float(median(asked.share[side][:, rows].mean(axis=0))) for side in (one, other)]
    hard, least = (one, share[1]) if share[0] > share[1] else (other, share[0])
    most = max(share)
    if most - least < _APART or most < _SPENT:
        return
    named = listed([str(asked.numbers[k]) for k in hard])
    yield Finding(
        kind="motor",
        title=f"motors {named} work harder than those that turn the other way",
        onset_s=aloft[0][0],
        end_s=aloft[-1][1],
        severity="warning",
        evidence=(
            f"{most:.0%} against {least:.0%} in the middle of the flight (limit {100 * _APART:.0f} points): something "
            "twists it, such as a crooked motor, a wrong propeller or a bent frame"
        ),
        source="actuator_motors or actuator_outputs, CA_ROTORn_KM",
        probability=_TRUE_P,
        mission_lost=_LOST_P,
    )


CHECK = Check("twist", "motors of one turning direction that work much harder", READS, LIMITS, find)

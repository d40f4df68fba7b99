"""A multicopter that spins the other way than its control asks for: it has no say in its heading any more."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import SPINS, Finding
from care_core.ecosystems.px4.flight import LANDED, Px4Flight
from care_core.ecosystems.spans import Span, inside, runs, seconds_in
from care_core.logs.base import Wanted
from care_core.numbers import Bools, Floats, median

_RATE, _ASKED, _THRUST = "vehicle_angular_velocity", "vehicle_rates_setpoint", "vehicle_thrust_setpoint"
READS: Wanted = {_RATE: ("xyz[2]",), _ASKED: ("yaw",), _THRUST: ("xyz[2]",), LANDED: ("landed",)}
LIMITS = Limits()
_OFF_DPS = LIMITS.add("turn off what is asked for", 90.0, "deg/s", "a choice: a gust or a swing turns it slower")
_SPINS_DPS = LIMITS.add("turn of what spins", 60.0, "deg/s", "a choice: a turn that is asked for is followed closer")
_SPINS_S = LIMITS.add("shortest turn against its control", 2.0, "s", "a choice: a blow is countered sooner")
_GAP_S = LIMITS.add("pause that still counts as one turn", 2.0, "s", "the demand turns around with every half turn")
_LIFTS = LIMITS.add("thrust that flies", 0.1, "", "MPC_THR_MIN is 0.12 as shipped; what is carried asks for none")
_SPENT = LIMITS.add("thrust with nothing left", 0.9, "", "a choice: lift comes before heading in the mixer")
_HELD_P = LIMITS.add("probability of a part", 0.3, "", "a choice: what holds or strikes it shows alike")


def find(flight: Px4Flight) -> Iterator[Finding]:
    """The first such turn that lasts."""
    turned, asked = flight.table(_RATE, "xyz[2]"), flight.table(_ASKED, "yaw")
    thrust, landed = flight.table(_THRUST, "xyz[2]"), flight.table(LANDED, "landed")
    if turned is None or asked is None or thrust is None or landed is None or not flight.hovers:
        return
    t, rate = turned.t, np.nan_to_num(np.degrees(turned["xyz[2]"]))
    wanted = np.interp(t, asked.t, np.nan_to_num(np.degrees(asked["yaw"])))
    lift = np.interp(t, thrust.t, np.nan_to_num(-thrust["xyz[2]"]))
    flies = (lift > _LIFTS) & inside(flight.armed, t)
    flies &= (np.interp(t, landed.t, landed["landed"]) == 0) & (t < min(flight.kills, default=np.inf))
    against = flies & (np.abs(rate) > _SPINS_DPS) & (np.abs(rate - wanted) > _OFF_DPS)
    span = next((one for one in runs(t, against, _GAP_S) if _turned_s(t, against, one) >= _SPINS_S), None)
    if span is None:
        return
    during = (t >= span[0]) & (t <= span[1])
    most, lifts = float(np.max(np.abs(rate[during]))), float(median(lift[during]))
    why = (
        "the lift takes all that the motors have, and none is left to turn it"
        if lifts > _SPENT
        else "something holds or struck it, a motor gave way, or motors turn the wrong way"
    )
    yield Finding(
        kind="attitude",
        title=SPINS,
        onset_s=span[0],
        end_s=span[1],
        severity="critical",
        evidence=(
            f"it turns at up to {most:.0f} deg/s for {span[1] - span[0]:.1f} s, more than {_OFF_DPS:g} deg/s off what "
            f"it is told: {why}"
        ),
        source=f"{_RATE}.xyz[2], {_ASKED}.yaw",
        probability=_HELD_P,
    )


def _turned_s(t: Floats, against: Bools, span: Span) -> float:
    """For how long of a span it turned so."""
    return seconds_in(one for one in runs(t, against) if span[0] <= one[0] <= span[1])


CHECK = Check("spin", "a multicopter that spins against its control", READS, LIMITS, find)

"""What ends the outputs of motors (AP_MotorsMulticopter: output_to_pwm).

Of a copter that is MOT_PWM_MAX and MOT_SPIN_MAX, of a QuadPlane's lift motors Q_M_PWM_MAX and Q_M_SPIN_MAX.
"""

from __future__ import annotations

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.records import Record
from care_core.run import shown

_SHIPPED = {"SPIN_MAX": 0.95, "PWM_MAX": 2000.0, "PWM_MIN": 1000.0}
"""What the firmware comes with, where the log tells no default."""


class Kept(Record):
    """The parameter that takes most of the range of the motors' outputs."""

    parameter: str
    value: float
    wanted: float
    share: float
    """What is left of the range as shipped."""
    end_us: float
    """Where the outputs end, in microseconds."""
    whole_us: float
    """Where they end as shipped at most."""
    range_us: float
    """How long their range is as shipped."""

    def __str__(self) -> str:
        return f"{self.parameter} is {shown(self.value)} (as shipped {self.wanted:g})"


def kept_from_range(flight: Flight, motors: str) -> Kept | None:
    """What takes most of the range, None where nothing does. A pulse of 0 leaves the range to the receiver's.

    Args:
        motors: how their parameters begin: MOT_ or Q_M_.
    """
    left = {name: flight.default_left(motors + name) for name in _SHIPPED}
    whole = {name: left[name] or shipped for name, shipped in _SHIPPED.items()}
    driven = {name: flight.setting(motors + name) or value for name, value in whole.items()}
    range_us = whole["PWM_MAX"] - whole["PWM_MIN"]
    if range_us <= 0.0:
        return None
    shares = {
        "SPIN_MAX": driven["SPIN_MAX"] / whole["SPIN_MAX"],
        "PWM_MAX": (driven["PWM_MAX"] - whole["PWM_MIN"]) / range_us,
    }
    share, name = min((share, name) for name, share in shares.items())
    end_us = driven["PWM_MIN"] + driven["SPIN_MAX"] * (driven["PWM_MAX"] - driven["PWM_MIN"])
    return (
        Kept(motors + name, driven[name], whole[name], share, end_us, whole["PWM_MAX"], range_us)
        if share < 1.0
        else None
    )

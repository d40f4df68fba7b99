"""Failsafes, and a flight too low to tell by its height, that a vehicle's heartbeat alone tells of.

The firmware sends MAV_STATE_CRITICAL while any failsafe is on (GCS_MAVLink: vehicle_system_status), and so it does
after an internal error (GCS_MAVLINK::system_status).
"""

from __future__ import annotations

import re

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.statistics import lasting
from care_core.ecosystems.spans import Span, during
from care_core.ecosystems.vehicles import flies

_ACTIVE, _CRITICAL = 4, 5
"""MAV_STATE."""
_LASTS_S, _GAP_S = 2.0, 2.5
"""One of before arming, which the first word of pilot or ground station ends, is over sooner; a link drops beats."""
_BEFORE_S, _AFTER_S = 30.0, 3.0
"""The firmware says at least as often what keeps it from arming (AP_Arming: every 30 s), and of what acts at once."""
_SPEAKS = re.compile(
    r"failsafe|EKF variance|low battery|battery .*is (low|critical)|lost (manual control|pilot input)", re.IGNORECASE
)
_OVER = re.compile(r"clear|\boff\b|\bover\b|disabled|regained", re.IGNORECASE)


def told_to_fly(flight: Flight) -> tuple[Span, ...]:
    """When its heartbeat said that it flies while it was armed: of a copter, what its land detector finds
    (GCS_MAVLINK_Copter::vehicle_system_status)."""
    beats = flight.one("STAT", "State")
    if beats is None or not flies(flight.kind):
        return ()
    return tuple(lasting(beats.t, (beats["State"] == _ACTIVE) & during(flight.armed, beats.t), _LASTS_S, gap_s=_GAP_S))


def shown_failsafes(flight: Flight) -> tuple[tuple[Span, str], ...]:
    """When its heartbeat said that a failsafe is on while it was armed, and in words with the nearest text of one."""
    beats = flight.one("STAT", "State")
    if beats is None or flight.kind == "unknown":
        return ()
    spans = lasting(beats.t, (beats["State"] == _CRITICAL) & during(flight.armed, beats.t), _LASTS_S, gap_s=_GAP_S)
    errors = [t for t, text in flight.messages if "internal error" in text.casefold()]
    return tuple((span, _words(flight, span[0])) for span in spans if not any(t <= span[1] for t in errors))


def _words(flight: Flight, t: float) -> str:
    said = flight.messages_between(t - _BEFORE_S, t + _AFTER_S)
    of_one = [(at, text) for at, text in said if _SPEAKS.search(text) and not _OVER.search(text)]
    near = f" ({min(reversed(of_one), key=lambda one: abs(one[0] - t))[1]})" if of_one else ""
    return f"failsafe told by the heartbeat{near}"

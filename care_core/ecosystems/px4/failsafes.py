"""What a failsafe is about: the flags of failsafe_flags (FailsafeFlags.msg) that are up as it acts."""

from __future__ import annotations

from collections.abc import Mapping

from care_core.ecosystems.px4.flight import FLAGS, STATUS, Px4Flight
from care_core.logs.base import Wanted

REASONS: Mapping[str, tuple[str, ...]] = {
    "battery": ("battery_warning", "battery_unhealthy", "battery_low_remaining_time"),
    "geofence": ("geofence_breached",),
    "position": (
        "local_position_invalid", "global_position_invalid", "local_velocity_invalid",
        "local_position_accuracy_low", "position_accuracy_low",
    ),
    "attitude": ("attitude_invalid", "angular_velocity_invalid", "fd_critical_failure"),
    "motor": ("fd_motor_failure", "fd_esc_arming_failure", "fd_imbalanced_prop"),
    "link": ("manual_control_signal_lost", "gcs_connection_lost", "offboard_control_signal_lost"),
    "mission": ("mission_failure",),
    "wind": ("wind_limit_exceeded",),
    "flight time": ("flight_time_limit_exceeded",),
}  # fmt: skip
_NEEDED = {
    "local_position_invalid": ("mode_req_local_position", "mode_req_local_position_relaxed"),
    "global_position_invalid": ("mode_req_global_position", "mode_req_global_position_relaxed"),
    "offboard_control_signal_lost": ("mode_req_offboard_signal",),
}
"""Flags that are up in many a sound flight, each with the masks of modes (bits by nav_state) that need what it says is
missing."""
INTENDED = "nav_state_user_intention"
"""The mode that was asked for; `nav_state` is the one that acts."""
READS: Wanted = {
    FLAGS: (
        *(flag for flags in REASONS.values() for flag in flags),
        *(mask for masks in _NEEDED.values() for mask in masks),
    ),
    STATUS: ("nav_state", INTENDED),
}

_CRITICAL_WARNING = {"battery_warning": 2}
"""battery_warning counts from critical on (battery_status.msg); the others are true or false."""
_NEAR_S, _ROSE_S = 1.0, 0.3
"""A failsafe acts within a second of its reason; what it is told by rose just before."""
_MOST = 2
_LINKS = {
    "manual_control_signal_lost": "radio",
    "gcs_connection_lost": "ground station",
    "offboard_control_signal_lost": "offboard link",
}


def reasons(flight: Px4Flight, acted_s: float) -> tuple[str, ...]:
    """What a failsafe was about that acted at a time."""
    near = (acted_s - _NEAR_S, acted_s + _NEAR_S)
    return tuple(
        about
        for about, flags in REASONS.items()
        if any(
            flight.at_least(FLAGS, flag, _CRITICAL_WARNING.get(flag, 1), near) and matters(flight, flag, acted_s)
            for flag in flags
        )
    )


def matters(flight: Px4Flight, flag: str, t: float) -> bool:
    """Whether the mode that was asked for at a time needs what a flag says is missing; true where the log does not tell
    which modes do (before 1.14)."""
    masks = [mask for name in _NEEDED.get(flag, ()) if (mask := flight.last(FLAGS, name, t)) is not None]
    mode = flight.last(STATUS, INTENDED, t)
    return not masks or mode is None or any(int(mask) >> int(mode) & 1 for mask in masks)


def rose_with(flight: Px4Flight, flag: str, acted_s: float) -> bool:
    """Whether a flag rose as a failsafe acted."""
    return any(value > 0 and abs(t - acted_s) < _ROSE_S for t, value in flight.changes(FLAGS, flag))


def in_words(flight: Px4Flight, acted_s: float) -> str:
    """The same in a word or two: by the flags that rose with it, else by those that were up; empty where none was, or
    where so many were that none tells."""
    rose = tuple(
        flag
        for flags in REASONS.values()
        for flag in flags
        if rose_with(flight, flag, acted_s) and matters(flight, flag, acted_s)
    )
    words = [_LINKS.get(flag) or next(about for about, flags in REASONS.items() if flag in flags) for flag in rose]
    told = dict.fromkeys(words or reasons(flight, acted_s))
    return " and ".join(told) if len(told) <= _MOST else ""

"""Flags by which the vehicle itself says what is wrong."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.px4.attitude import READS as ATTITUDE_READS
from care_core.ecosystems.px4.episodes import Episode, State, episode
from care_core.ecosystems.px4.flight import FLAGS, STATUS, Px4Flight
from care_core.ecosystems.vehicles import way_of
from care_core.logs.base import Wanted, merge_needs
from care_core.records import replace
from care_core.text import listed

_OLD_FLAGS, _ESTIMATOR = "vehicle_status_flags", "estimator_status_flags"

LIMITS = Limits()  # the vehicle applies its own
_FLIGHTS = "training flights"
_LOW_P = LIMITS.add(
    "probability of a battery that will not last", 0.03, "", "flights: none of 17 whose battery shows nothing else"
)
_LOW_LOST_P = LIMITS.add("probability that a mission fails with such a battery", 0.9, "", f"{_FLIGHTS}: 17 of 19")
_NOWHERE_P = LIMITS.add("probability of the GPS, no global position", 0.9, "", f"{_FLIGHTS}: 8 of 8")
_NOWHERE_LOST_P = LIMITS.add("probability that a mission fails without one", 0.9, "", f"{_FLIGHTS}: 8 of 8")
_TIPPED_P = LIMITS.add("probability of gains, attitude beyond limits", 0.85, "", f"{_FLIGHTS}: 17 of 20, else motors")
_DISTURBED_P = LIMITS.add("probability of the compass, field disturbed", 0.85, "", f"{_FLIGHTS}: 4 of 4")
_DISTURBED_LOST_P = LIMITS.add("probability that a mission fails in such a field", 0.1, "", f"{_FLIGHTS}: 0 of 6")
_BUMPED_P = LIMITS.add(
    "probability of a part, vertical accelerations", 0.1, "", f"{_FLIGHTS}: after falls; vibration has its own check"
)
_UNAIDED_P = LIMITS.add("probability of a part, no position aid", 0.8, "", f"{_FLIGHTS}: 8 of 9, all of the GPS")
_UNAIDED_LOST_P = LIMITS.add("probability that a mission fails without it", 0.9, "", f"{_FLIGHTS}: 8 of 9")
_LINK_P = LIMITS.add("probability of a link whose failsafe acted", 0.95, "", "the firmware's own flag, as it acts")

_TIGHT_P = LIMITS.add(
    "probability of a limit of the failure detector, within what it may lean", 0.95, "", "its limits and its lean"
)

STATES = (
    State(STATUS, "failsafe", "failsafe"),
    State(STATUS, "rc_signal_lost", "radio lost", "radio"),
    State(STATUS, "data_link_lost", "ground station lost", "radio", "info"),
    State(STATUS, "engine_failure", "engine failure", "motor", "critical"),
    State(STATUS, "mission_failure", "mission cannot be flown", "planner", "warning", "operation"),
    State(FLAGS, "manual_control_signal_lost", "radio lost", "radio"),
    State(FLAGS, "gcs_connection_lost", "ground station lost", "radio", "info"),
    State(FLAGS, "battery_unhealthy", "battery unhealthy", "battery", "critical"),
    State(FLAGS, "battery_low_remaining_time", "battery will not last to reach home", "battery",
          probability=_LOW_P, mission_lost=_LOW_LOST_P),
    State(FLAGS, "geofence_breached", "geofence breached"),
    State(FLAGS, "local_position_invalid", "no valid local position", "estimator"),
    State(FLAGS, "global_position_invalid", "no valid global position", "gps",
          probability=_NOWHERE_P, mission_lost=_NOWHERE_LOST_P),
    State(FLAGS, "attitude_invalid", "no valid attitude", "estimator", "critical"),
    State(FLAGS, "angular_velocity_invalid", "no valid rotation rate", "imu", "critical"),
    State(FLAGS, "wind_limit_exceeded", "wind above its limit"),
    State(FLAGS, "fd_critical_failure", "attitude beyond the failure detector's limits", "attitude", "critical",
          "parameter", _TIPPED_P),
    State(FLAGS, "fd_motor_failure", "motor failure", "motor", "critical"),
    State(FLAGS, "fd_esc_arming_failure", "an ESC did not arm", "motor", "critical"),
    State(FLAGS, "fd_imbalanced_prop", "imbalanced propeller", "vibration"),
    State(_OLD_FLAGS, "condition_battery_healthy", "battery unhealthy", "battery", "critical"),
    State(_OLD_FLAGS, "vtol_transition_failure", "transition failed", "attitude"),
    State(_ESTIMATOR, "cs_mag_field_disturbed", "magnetic field disturbed", "compass",
          probability=_DISTURBED_P, mission_lost=_DISTURBED_LOST_P),
    State(_ESTIMATOR, "cs_mag_fault", "compass given up by the estimator", "compass"),
    State(_ESTIMATOR, "cs_inertial_dead_reckoning", "estimator without position aid", "estimator",
          probability=_UNAIDED_P, mission_lost=_UNAIDED_LOST_P),
    State(_ESTIMATOR, "fs_bad_acc_vertical", "vertical accelerations make no sense", "vibration",
          probability=_BUMPED_P),
    State(_ESTIMATOR, "fs_bad_acc_clipping", "accelerometers clip", "vibration"),
)  # fmt: skip
"""msg/VehicleStatus.msg, FailsafeFlags.msg, VehicleStatusFlags.msg (to 1.13) and EstimatorStatusFlags.msg."""
_ACTIONS = {
    "rc_signal_lost": "NAV_RCL_ACT",
    "manual_control_signal_lost": "NAV_RCL_ACT",
    "data_link_lost": "NAV_DLL_ACT",
    "gcs_connection_lost": "NAV_DLL_ACT",
}
"""What says how the vehicle acts where it loses a link."""
_DETECTED = ("FD_FAIL_R", "FD_FAIL_P")
"""Beyond which roll and pitch a vehicle has failed, degrees; 0 for never."""
_AT_ONCE_S = 1.5
_OF_PARTS = frozenset((
    "battery_unhealthy", "battery_low_remaining_time", "condition_battery_healthy", "global_position_invalid",
))  # fmt: skip
"""What the vehicle says of a part also where none is connected."""
_GOOD_WHEN_SET = frozenset(("condition_battery_healthy",))

READS: Wanted = merge_needs((ATTITUDE_READS, *({state.topic: (state.field,)} for state in STATES)))


def episodes(flight: Px4Flight) -> Iterator[Episode]:
    """What was flagged while it was armed."""
    for state in STATES:
        table = flight.table(state.topic, state.field)
        if table is not None and not (state.field in _OF_PARTS and flight.has_no(state.kind)):
            bad = table[state.field] == (0 if state.field in _GOOD_WHEN_SET else 1)
            found = episode(flight, table, bad, state, f"{state.topic}.{state.field}")
            if found is not None:
                yield found


def find(flight: Px4Flight) -> Iterator[Finding]:
    for found in episodes(flight):
        finding = found.finding()
        if finding is not None:
            yield _too_tight(flight, found, _acted_on(flight, found, finding))


def _acted_on(flight: Px4Flight, found: Episode, finding: Finding) -> Finding:
    """A lost link on which a failsafe acted that broke a mission off: how it is set says so."""
    action = _ACTIONS.get(found.state.field)
    if action is None:
        return finding
    near = (found.start_s - _AT_ONCE_S, found.start_s + _AT_ONCE_S)
    before = [mode for t, mode in flight.modes if t < near[0]]
    acted = any(value > 0 and near[0] <= t <= near[1] for t, value in flight.changes(STATUS, "failsafe"))
    if not acted or not before or way_of("px4", before[-1]) != "mission":
        return finding
    value = flight.parameter(action)
    how = "" if value is None else f"; {action} is {value:g}, which acts on it in a mission"
    return replace(finding, severity="critical", probability=_LINK_P, evidence=f"{finding.evidence}{how}")


def _too_tight(flight: Px4Flight, found: Episode, finding: Finding) -> Finding:
    """A failure detector that acts on a lean which the vehicle is flown with."""
    allowed, lean = flight.parameter("MPC_TILTMAX_AIR"), flight.lean
    if found.state.field != "fd_critical_failure" or allowed is None or lean is None:
        return finding
    set_to = {name: value for name in _DETECTED if (value := flight.parameter(name)) is not None}
    tight = tuple(name for name, value in set_to.items() if 0 < value < allowed)
    leaned = float(np.nanmax(lean.tilt_deg[(lean.t >= found.start_s) & (lean.t <= found.end_s)], initial=0.0))
    if not tight or leaned > allowed:
        return finding
    limits = listed([f"{name} is {set_to[name]:g} deg" for name in tight])
    evidence = (
        f"{finding.evidence}; {limits}, it leaned {leaned:.0f} deg at the most, and MPC_TILTMAX_AIR lets it lean "
        f"{allowed:g} deg"
    )
    return replace(finding, parameters=tight, probability=_TIGHT_P, evidence=evidence)


CHECK = Check("flags", "what the vehicle itself reports as failed, lost or beyond its limits", READS, LIMITS, find)

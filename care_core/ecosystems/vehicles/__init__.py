"""What is known of vehicles before any log is read: their modes, errors, events, motors and the names of parameters.

Facts of ArduPilot's and PX4's source, as tables. Knows nothing of logs.
"""

from care_core.ecosystems.vehicles.arming import method_words, unrecorded_changes
from care_core.ecosystems.vehicles.errors import FAILSAFE, error_kind, error_words, is_over
from care_core.ecosystems.vehicles.events import event_words
from care_core.ecosystems.vehicles.modes import Way, mode_name, mode_number, reason_words, way_of
from care_core.ecosystems.vehicles.motors import (
    Motor,
    is_skid_steered,
    motor_outputs,
    motors_at,
    motors_of,
    switched_off,
)
from care_core.ecosystems.vehicles.self_written import is_self_written
from care_core.ecosystems.vehicles.vehicle import (
    UNLIKE_ROVERS,
    Kind,
    Vehicle,
    flies,
    is_simulated,
    vehicle_of,
    vehicle_of_run,
)

__all__ = [
    "FAILSAFE",
    "UNLIKE_ROVERS",
    "Kind",
    "Motor",
    "Vehicle",
    "Way",
    "error_kind",
    "error_words",
    "event_words",
    "flies",
    "is_over",
    "is_self_written",
    "is_simulated",
    "is_skid_steered",
    "method_words",
    "mode_name",
    "mode_number",
    "motor_outputs",
    "motors_at",
    "motors_of",
    "reason_words",
    "switched_off",
    "unrecorded_changes",
    "vehicle_of",
    "vehicle_of_run",
    "way_of",
]

"""Parameters that are not options, and why: data, by shell patterns.

Beside these stand the parameters that a vehicle writes itself (`vehicles.self_written`).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from fnmatch import translate

from care_core.ecosystems.vehicles.self_written import SELF_WRITTEN, SIMULATOR_PREFIX

_WIRING = "wiring, radio, logging and what is fitted"
_CODES = "codes and bit masks whose meaning is not known here"
_SIMULATOR = {"the simulated world": (f"{SIMULATOR_PREFIX}*", "SIH_*")}
_ROBOT = "what the robot and its map are"
_SHOWN = "what it shows to whoever looks on"

EXCLUDED: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "ardupilot": {
        **_SIMULATOR,
        **SELF_WRITTEN,
        _WIRING: (
            "SERIAL*", "SR[0-9]*_*", "FRAME", "LED_*", "SYSID_*", "MAV_*", "MAV[0-9]*_*", "BRD_*", "CAN_*", "LOG_*",
            "NTF_*", "OSD*", "MSP_*", "RCMAP_*", "RC[0-9]*_*", "RC_*", "SERVO*", "RELAY*", "RPM*", "SCHED_*",
            "ADSB_*", "VTX_*", "SCR_*", "DDS_*", "NET_*", "FRAME_*", "CAM*", "MNT*", "EAHRS*", "FLOW_*", "VISO_*",
            "BATT*_MONITOR", "BATT*_PIN", "BATT*_CAPACITY", "BATT*_AMP_*", "BATT*_VOLT_MULT", "BATT*_VOLT_PIN",
            "BATT*_CURR_PIN", "GPS*_POS*", "INS_POS*", "AHRS_ORIENTATION", "COMPASS_*", "GND_*", "BARO*",
            "TERRAIN_*", "MIS_*", "FLTMODE*", "MODE*", "INITIAL_MODE", "ARMING_*", "DEV_*", "FORMAT_VERSION",
            "STICK_MIXING", "GCS_*", "TELEM_*", "FFT_*",
        ),
        _CODES: (
            "*_TYPE", "*_TYPE[0-9]", "*_ENABLE", "*_ENABLED", "*_ENAB", "*_OPTIONS", "*_OPT", "*_ACTION", "*_MASK",
            "*_BITMASK", "*_ADDR", "*_BUS", "*_ORIENT*", "*_ID", "*_PIN*", "*_USE", "*_CHANNEL", "*_CHAN", "*_SRC",
            "*_SRC[0-9]*",
        ),
    },
    "px4": {
        **_SIMULATOR,
        **SELF_WRITTEN,
        _WIRING: (
            "SYS_*", "SER_*", "MAV_*", "SDLOG_*", "CA_*", "PWM_*", "UAVCAN_*", "CBRK_*", "RC*", "SENS_*",
            "BAT*_N_CELLS", "BAT*_CAPACITY", "BAT*_SOURCE", "BAT*_V_*", "BAT*_A_*", "BAT*_I_*", "EKF2_*_POS_*",
            "COM_FLTMODE*", "TRIG_*", "CAM_*", "MNT_*", "GPS_*", "DSHOT_*", "UXRCE_*", "IMU_GYRO_CAL*", "SYSTEM*",
            "HIL_*", "OSD_*",
        ),
        _CODES: (
            "*_EN", "*_EN_*", "*_TYPE", "*_ID", "*_CTRL", "*_MASK", "*_CFG", "*_SEL", "*_MODE", "*_REF", "*_ACT",
            "MAN_ARM_*",
        ),
    },
    "ros1": {
        _ROBOT: ("width", "height", "origin_*", "robot_radius", "footprint", "use_sim_time", "restore_defaults"),
        _SHOWN: ("publish_cost_grid*", "publish_traj_pc", "publish_voxel_map", "visualize_*", "map_vis_z"),
    },
    "ros2": {
        _ROBOT: ("width", "height", "origin_*", "robot_radius", "footprint", "use_sim_time", "robot_base*",
                 "initial_pose.*", "set_initial_pose", "always_reset_initial_pose", "first_map_only",
                 "rolling_window", "unknown_cost_value", "external_detection_*", "*.marking", "*.clearing",
                 "*.inf_is_valid"),
        "how its messages are sent": (
            "qos_overrides.*", "bond_*", "*service_introspection*", "introspection_mode", "action_introspection*",
            "start_type_description*", "enable_stamped_cmd_vel", "map_subscribe_transient_local",
            "allow_parameter_qos_overrides",
        ),
        "how its nodes are started and watched": (
            "autostart*", "attempt_respawn*", "respawn_*", "use_respawn", "use_composition", "use_intra_process*",
            "use_realtime_priority", "diagnostic_updater*", "log_level", "*groot_*", "stop_on_failure",
        ),
        _SHOWN: (
            "publish_cost_grid*", "publish_evaluation", "publish_global_plan", "publish_local_plan",
            "publish_trajectories", "publish_transformed_plan", "publish_voxel_map", "publish_critics_stats",
            "publish_optimal_trajectory*", "marker_lifetime", "visualize*", "*TrajectoryVisualizer.*",
            "always_send_full_costmap", "map_vis_z", "debug_*", "viz_*",
        ),
    },
}  # fmt: skip
"""Reason -> names: of a vehicle's parameter the whole name, of a node's what follows the node."""

_SIMULATED = "loopback_simulator"
_HELPER = "_rclcpp_node"
"""How Nav2 calls nodes beside its servers: they are given the file of their server, and read next to nothing of it."""

SAFETY = re.compile(
    "|".join(map(translate, ("FS_*", "FENCE_*", "BATT*_LOW_*", "BATT*_CRT_*", "BAT*_THR", "COM_LOW_BAT_*", "GF_*",
                             "COM_*_LOSS_*", "NAV_*LOSS*", "LOW_VOLT")))
)  # fmt: skip
"""Failsafes and fences: no fix may loosen them."""


def reason_to_exclude(stack: str, parameter: str) -> str:
    """Why a parameter is not an option; '' where nothing speaks against it."""
    name = parameter
    if stack == "ros1":
        name = parameter.rpartition("/")[2]
    elif stack == "ros2":
        node, dot, own = parameter.partition(".")
        if node.endswith(_HELPER):
            return "a helper node of another, whose own copy counts"
        if node.rpartition("/")[2] == _SIMULATED:
            return "the simulated world"
        name = (own if dot else node).lstrip("/")
    spellings = {name, name.rpartition(".")[2]}
    for reason, patterns in EXCLUDED.get(stack, {}).items():
        if any(re.fullmatch(translate(pattern), one) for pattern in patterns for one in spellings):
            return reason
    return ""

"""What the topics of PX4 mean: units, words, former names and plausible values, after its message definitions (msg/).

Plausible ranges are what the part measured can do, not what is healthy: beyond them a sensor or its driver is at fault.
"""

from __future__ import annotations

from collections.abc import Mapping

from care_core.ecosystems.dictionary import Dictionary, Field, Message
from care_core.ecosystems.px4 import failsafes
from care_core.ecosystems.px4.checks import flags
from care_core.ecosystems.px4.flight import FLAGS

_SHARE = (0.0, 1.0)
_LATITUDE, _LONGITUDE = (-90.0, 90.0), (-180.0, 180.0)
_RATIO = (0.0, float("inf"))

_FLAGS: Mapping[str, Mapping[str, Field]] = {
    topic: {state.field: Field(label=state.means, plausible=_SHARE) for state in flags.STATES if state.topic == topic}
    for topic in flags.READS
}
_GPS: Mapping[str, Field] = {
    "fix_type": Field(label="kind of fix", plausible=(0.0, 8.0)),
    "satellites_used": Field(label="satellites", plausible=(0.0, 255.0)),
    "hdop": Field(label="horizontal dilution", plausible=(0.0, 100.0)),
    "eph": Field("m", "horizontal accuracy", plausible=_RATIO),
    "epv": Field("m", "vertical accuracy", plausible=_RATIO),
    "latitude_deg": Field("deg", "latitude", ("lat",), _LATITUDE, is_position=True),
    "longitude_deg": Field("deg", "longitude", ("lon",), _LONGITUDE, is_position=True),
    "altitude_msl_m": Field("m", "height above the sea", ("alt",), is_position=True),
    "vel_m_s": Field("m/s", "speed over ground"),
}


def _along(axes: str, unit: str, words: str) -> dict[str, Field]:
    return {f"{axes}[{number}]": Field(unit, f"{words} {axis}") for number, axis in enumerate(("x", "y", "z"))}


MESSAGES: Dictionary = {
    **{topic: Message(fields) for topic, fields in _FLAGS.items()},
    FLAGS: Message({
        **{name: Field(label=name.replace("_", " ")) for name in failsafes.READS[FLAGS]},
        **_FLAGS[FLAGS],
    }),
    "vehicle_status": Message({
        **_FLAGS["vehicle_status"],
        "arming_state": Field(label="arming state"),
        "nav_state": Field(label="mode"),
        failsafes.INTENDED: Field(label="mode that was asked for"),
        "failure_detector_status": Field(label="failures detected, as bits"),
        "vehicle_type": Field(label="kind of vehicle"),
    }),
    "logged_messages": Message({"level": Field(label="level"), "message": Field(label="message")}, at_times=True),
    "manual_control_setpoint": Message({
        "z": Field(label="throttle stick, from 0"),
        "throttle": Field(label="throttle stick, from -1"),
    }),
    "vehicle_land_detected": Message({"landed": Field(label="on the ground", plausible=_SHARE)}),
    "mission_result": Message({
        "finished": Field(label="mission finished", plausible=_SHARE),
        "failure": Field(label="mission failed", plausible=_SHARE),
        "seq_reached": Field(label="last waypoint reached"),
        "seq_total": Field(label="items of the mission"),
        "mission_id": Field(label="number of the mission"),
        "instance_count": Field(label="number of the mission"),
    }, at_times=True),
    **{
        topic: Message({}, at_times=True)
        for topic in ("event", "home_position", "parameter_update", "vehicle_command", "vehicle_command_ack")
    },
    "vehicle_local_position": Message({
        "x": Field("m", "position north", is_position=True),
        "y": Field("m", "position east", is_position=True),
        "z": Field("m", "position down"),
        "vx": Field("m/s", "speed north"),
        "vy": Field("m/s", "speed east"),
        "vz": Field("m/s", "speed down"),
        "heading": Field("rad", "heading"),
        "xy_valid": Field(label="whether the position is known, 1 where it is"),
        "z_valid": Field(label="whether the height is known, 1 where it is"),
    }),
    "vehicle_local_position_setpoint": Message({
        "x": Field("m", "position north wanted", is_position=True),
        "y": Field("m", "position east wanted", is_position=True),
        "z": Field("m", "position down wanted"),
        "vx": Field("m/s", "speed north wanted"),
        "vy": Field("m/s", "speed east wanted"),
        "vz": Field("m/s", "speed down wanted"),
    }),
    "vehicle_global_position": Message({
        "lat": Field("deg", "latitude", plausible=_LATITUDE, is_position=True),
        "lon": Field("deg", "longitude", plausible=_LONGITUDE, is_position=True),
        "alt": Field("m", "height above the sea", is_position=True),
    }),
    "vehicle_attitude": Message({f"q[{n}]": Field(label=f"attitude, quaternion {n}") for n in range(4)}),
    "vehicle_attitude_setpoint": Message({
        **{f"q_d[{n}]": Field(label=f"attitude wanted, quaternion {n}") for n in range(4)},
        "thrust_body[2]": Field(label="thrust wanted, downwards", plausible=(-1.0, 1.0)),
    }),
    "vehicle_thrust_setpoint": Message({
        "xyz[2]": Field(label="thrust wanted, downwards", plausible=(-1.0, 1.0)),
    }),
    "actuator_motors": Message({
        f"control[{n}]": Field(label=f"command of motor {n + 1}", plausible=(-1.0, 1.0)) for n in range(12)
    }),
    "actuator_outputs": Message({f"output[{n}]": Field(label=f"output {n + 1}") for n in range(16)}),
    "vehicle_angular_velocity": Message(_along("xyz", "rad/s", "rotation rate")),
    "vehicle_acceleration": Message(_along("xyz", "m/s2", "acceleration")),
    "vehicle_rates_setpoint": Message({
        "roll": Field("rad/s", "roll rate wanted"),
        "pitch": Field("rad/s", "pitch rate wanted"),
        "yaw": Field("rad/s", "yaw rate wanted"),
    }),
    "sensor_combined": Message({
        **_along("gyro_rad", "rad/s", "rotation rate"),
        **_along("accelerometer_m_s2", "m/s2", "acceleration"),
    }),
    "vehicle_air_data": Message({
        "baro_alt_meter": Field("m", "height by the barometer"),
        "baro_pressure_pa": Field("Pa", "air pressure"),
    }),
    "vehicle_imu_status": Message({
        "accel_vibration_metric": Field("m/s2", "vibration of the accelerometers"),
        "gyro_vibration_metric": Field("rad/s", "vibration of the gyros"),
    }),
    "vehicle_magnetometer": Message(_along("magnetometer_ga", "Gauss", "magnetic field")),
    "distance_sensor": Message({"current_distance": Field("m", "range")}),
    "airspeed": Message({"indicated_airspeed_m_s": Field("m/s", "indicated airspeed")}),
    "battery_status": Message({
        "voltage_v": Field("V", "battery voltage", plausible=_RATIO),
        "current_a": Field("A", "battery current"),
        "discharged_mah": Field("mAh", "charge drawn"),
        "remaining": Field("", "charge left, 0 to 1", plausible=_SHARE),
        "cell_count": Field(label="cells"),
        "warning": Field(label="battery warning"),
        "connected": Field(label="battery connected", plausible=_SHARE),
    }),
    "cpuload": Message({
        "load": Field("", "processor load, 0 to 1", plausible=_SHARE),
        "ram_usage": Field("", "memory in use, 0 to 1", plausible=_SHARE),
    }),
    "sensor_gps": Message(_GPS),
    "vehicle_gps_position": Message(_GPS),
    "estimator_status": Message({
        "vel_test_ratio": Field(label="velocity test ratio of the estimator", plausible=_RATIO),
        "pos_test_ratio": Field(label="position test ratio of the estimator", plausible=_RATIO),
        "hgt_test_ratio": Field(label="height test ratio of the estimator", plausible=_RATIO),
        "mag_test_ratio": Field(label="compass test ratio of the estimator", plausible=_RATIO),
        "hdg_test_ratio": Field(label="heading test ratio of the estimator", plausible=_RATIO),
    }),
}  # fmt: skip

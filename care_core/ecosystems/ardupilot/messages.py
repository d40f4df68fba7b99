"""What the messages of ArduPilot mean, under today's names: the one table that model, checks, measures and plots read.

DataFlash: docs "Log messages" and the FMTU records of its logs; telemetry: MAVLink's common.xml. Plausible ranges are
what any vehicle could record, not what is healthy. Gyros measure up to 70 rad/s (ICM-45686: 4000 degrees/s),
accelerometers up to 400 m/s^2 (ADIS16507: 40 g), a record of a field is of 16 bits. ArduPilot reads batteries at 10 Hz
and receivers at up to 20 Hz, its main loop runs at 400 Hz, its gyros at 8 kHz.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TypedDict

from care_core.ecosystems.dictionary import Dictionary, Field, Message
from care_core.logs.base import Wanted

_LATITUDE, _LONGITUDE = (-90.0, 90.0), (-180.0, 180.0)
_HEIGHT_M = (-1e4, 1e5)
_COPTER_HEIGHT_M = (-1.2e4, 1e5)
_STEP_DEG, _STEP_M = 5e-4, 50.0
"""50 m in a sample."""
_GYROS_HZ = 2e4


def _placed(unit: str, label: str, plausible: tuple[float, float] | None = None, step: float | None = None) -> Field:
    return Field(unit, label, plausible=plausible, step=step, is_position=True)


def _axes(
    name: str, unit: str, label: str, axes: str = "XYZ", most: tuple[float, float] | None = None
) -> dict[str, Field]:
    return {f"{name}{axis}": Field(unit, label, plausible=most) for axis in axes}


class _Logged(TypedDict):
    log_bits: int
    how_to_record: str


def _set(bits: int, name: str) -> _Logged:
    """How to have messages written that bits of ArduCopter's LOG_BITMASK stand for."""
    return {"log_bits": bits, "how_to_record": f"set '{name}' ({bits}) in LOG_BITMASK"}


_ATTITUDE, _NAVIGATION, _PID = _set(1 | 2, "attitude"), _set(32, "navigation tuning"), _set(4096, "PID")

_BATTERY_FIELDS: Mapping[str, Field] = {
    "Inst": Field(former=("Instance",)),
    "Volt": Field("V", "battery voltage", plausible=(0, 1e3), step=5.0),
    "Curr": Field("A", "battery current", plausible=(-1e3, 1e4)),
    "EnrgTot": Field("Wh", "energy drawn", plausible=(-1e6, 1e6), step=5.0),
    "CurrTot": Field("mAh", "charge drawn"),
    "Res": Field("ohm", "estimated resistance of the battery"),
}
_OLD_BATTERY_FIELDS = {"Volt": Field(label="battery voltage"), "Curr": Field(label="battery current")}
"""Before 3.3, in hundredths of a volt and of an ampere: no range of today's holds."""
_TEST_RATIOS = {
    f"S{letter}": Field(label=f"{what} test ratio of the estimator")
    for letter, what in (("V", "velocity"), ("P", "position"), ("H", "height"), ("M", "compass"))
}
_PLACE = {"Lat": _placed("deg", "latitude"), "Lng": _placed("deg", "longitude"), "Alt": _placed("m", "height")}


def _along(axis: str, end: str, *, is_position: bool) -> Message:
    """Position, velocity and acceleration controller of one axis, with its fields' last letter."""
    return Message(
        {
            f"P{end}": Field("m", f"position {axis}", is_position=is_position),
            f"TP{end}": Field("m", f"position {axis} wanted", is_position=is_position),
            f"DP{end}": Field("m", f"position {axis} planned", is_position=is_position),
            f"V{end}": Field("m/s", f"speed {axis}"),
            f"A{end}": Field("m/s2", f"acceleration {axis}"),
            f"TA{end}": Field("m/s2", f"acceleration {axis} wanted"),
            f"DA{end}": Field("m/s2", f"acceleration {axis} planned"),
        },
        at_times=True,
        **_NAVIGATION,
    )


_FLIGHT: Dictionary = {
    "ATT": Message(
        {
            "Roll": Field("deg", "roll", plausible=(-360, 360)),
            "Pitch": Field("deg", "pitch", plausible=(-360, 360)),
            "Yaw": Field("deg", "heading", plausible=(-360, 720)),
            "DesRoll": Field("deg", former=("RollIn",)),
            "DesPitch": Field("deg", former=("PitchIn",)),
            "DesYaw": Field("deg", former=("NavYaw",)),
        },
        moving=("Roll", "Pitch"), fastest_hz=1_000.0, slowest_s=30.0, **_ATTITUDE,
    ),
    "RATE": Message(
        {
            "R": Field("deg/s", "roll rate"),
            "P": Field("deg/s", "pitch rate"),
            "Y": Field("deg/s", "yaw rate"),
            "ROut": Field(label="roll output, -1 to 1"),
            "POut": Field(label="pitch output, -1 to 1"),
            "YOut": Field(label="yaw output, -1 to 1"),
        },
        fastest_hz=_GYROS_HZ, **_ATTITUDE,
    ),
    "POS": Message(
        {
            "Lat": _placed("deg", "latitude", _LATITUDE, _STEP_DEG),
            "Lng": _placed("deg", "longitude", _LONGITUDE, _STEP_DEG),
            "Alt": _placed("m", "height above the sea"),
            "RelHomeAlt": Field("m", "height above home", plausible=_HEIGHT_M, step=_STEP_M),
        },
        moving=("Lat", "Lng"), fastest_hz=1_000.0, slowest_s=30.0, **_ATTITUDE,
    ),
    "CTUN": Message(
        {
            "Alt": Field("m", "height", plausible=_COPTER_HEIGHT_M),
            "BAlt": Field("m", "height by the barometer", ("BarAlt",), _COPTER_HEIGHT_M),
            "DAlt": Field("m", former=("WPAlt",), plausible=_COPTER_HEIGHT_M),
            "SAlt": Field("m", former=("SonAlt",)),
            "CRt": Field("cm/s", "climb rate", ("CRate",)),
            "DCRt": Field("cm/s", former=("DCRate",)),
            "ThO": Field(label="throttle", former=("ThrOut",)),
            "ThI": Field(former=("ThrIn",)),
            "ThrOut": Field(label="throttle"),
            "As": Field("m/s", "airspeed", former=("Aspd",)),
        },
        **_set(16, "control tuning"),
    ),
    "PSCN": _along("north", "N", is_position=True),
    "PSCE": _along("east", "E", is_position=True),
    "PSCD": _along("down", "D", is_position=False),
    "STER": Message({
        "TurnRate": Field("deg/s", "turn rate"),
        "SteerOut": Field(label="steering output"),
        "LatAcc": Field("m/s2", "lateral acceleration"),
    }),
    "THR": Message({"Speed": Field("m/s", "speed"), "ThrOut": Field("%", "throttle output")}),
    "NTUN": Message({
        **{name: _placed("", "") for name in ("DPosX", "DPosY", "PosX", "PosY")},
        "AltE": Field("m", "height error"),
        "XT": Field("m", "distance from the line"),
        "TAsp": Field("m/s", "airspeed wanted"),
    }),
    "TECS": Message({
        "h": Field("m", "height"),
        "hdem": Field("m", "height wanted"),
        "dh": Field("m/s", "climb rate"),
        "dhdem": Field("m/s", "climb rate wanted"),
        "sp": Field("m/s", "airspeed"),
        "spdem": Field("m/s", "airspeed wanted"),
    }),
    "AETR": Message({
        "Ail": Field(label="ailerons, -4500 to 4500"),
        "Elev": Field(label="elevator, -4500 to 4500"),
        "Thr": Field("%", "throttle"),
    }),
    "AHR2": Message(_PLACE),
    "ORGN": Message(
        {"Lat": _placed("deg", "latitude", _LATITUDE), "Lng": _placed("deg", "longitude", _LONGITUDE)},
        in_bursts=True, at_times=True,
    ),
    "CMD": Message(
        {
            "Lat": Field("deg", plausible=_LATITUDE),
            "Lng": Field("deg", plausible=_LONGITUDE),
            "Alt": Field("m", plausible=_HEIGHT_M),
        },
        in_bursts=True, at_times=True, **_set(256, "mission commands"),
    ),
    "MODE": Message({"ModeNum": Field(former=("Mode",))}, at_times=True),
    **{name: Message({}, at_times=True) for name in ("ARM", "ERR", "EV", "MISE")},
    "PM": Message({"NL": Field(former=("NLoop",))}),
    **{name: Message({}, in_bursts=True, at_times=True) for name in ("PARM", "MSG", "RALY", "FNCE")},
    **{name: Message({}, fastest_hz=_GYROS_HZ, **_PID) for name in ("PIDR", "PIDP", "PIDY")},
    "MOTB": Message({}, **_set(131072, "motors")),
}  # fmt: skip
_SENSORS: Dictionary = {
    "IMU": Message(
        _axes("Gyr", "rad/s", "rotation", most=(-100, 100)) | _axes("Acc", "m/s2", "acceleration", most=(-1e3, 1e3)),
        ("IMU2", "IMU3"), "I", fastest_hz=_GYROS_HZ, **_set(128, "IMU"),
    ),
    "GYR": Message({}, instance="I", fastest_hz=_GYROS_HZ),
    **{name: Message({}, in_bursts=True, at_times=True) for name in ("ISBH", "ISBD")},
    "ACC": Message({}, fastest_hz=_GYROS_HZ),
    "VIBE": Message(
        _axes("Vibe", "m/s2", "vibration", most=(0, 1e3)) | {"Clip": Field(former=("Clip0",))},
        instance="IMU", **_set(128, "IMU"),
    ),
    "MAG": Message(
        _axes("Mag", "mGauss", "magnetic field", most=(-32768, 32767)), ("MAG2", "MAG3"), "I",
        **_set(8192, "compass"),
    ),
    "BARO": Message(
        {"Alt": Field("m", "height by the barometer"), "Press": Field("Pa", "air pressure")}, ("BAR2", "BAR3"), "I"
    ),
    "GPS": Message(
        {
            **_PLACE,
            "NSats": Field(label="satellites"),
            "HDop": Field(label="horizontal dilution", plausible=(0, 655.35)),
            "Spd": Field("m/s", "speed over ground", plausible=(0, 600)),  # receivers give up at 515
        },
        ("GPS2", "GPSB"), "I", fastest_hz=100.0, **_set(4, "GPS"),
    ),
    "GPA": Message({}, ("GPA2",), "I"),
    "BAT": Message(
        _BATTERY_FIELDS, ("CURR", "BAT2", "CUR2", "CURR2"), "Inst", fastest_hz=100.0, slowest_s=60.0,
        **_set(512, "battery monitor"),
    ),
    **{name: Message(_OLD_BATTERY_FIELDS) for name in ("CURR", "CUR2", "CURR2")},
    "RCOU": Message(
        {
            f"C{n}": Field("us", "motor and servo outputs", (f"Ch{n}", f"Chan{n}", f"Mot{n}"))
            for n in range(1, 15)
        },
        ("MOT",), **_set(1024, "RC output"),
    ),
    "RCIN": Message(
        {f"C{n}": Field("us", former=(f"Ch{n}", f"Chan{n}")) for n in range(1, 15)}, **_set(64, "RC input")
    ),
    "RFND": Message({"Dist": Field("m", former=("Dist1",))}, instance="Instance"),
    "ESC": Message({"RPM": Field("1/min")}, instance="Instance"),
    "XKF1": Message({}, ("NKF1", "EKF1", "NKF6"), "C"),
    "XKF2": Message({"VWN": Field("m/s", "wind north"), "VWE": Field("m/s", "wind east")}, ("NKF2", "NKF7"), "C"),
    "XKF3": Message(
        {
            "IVN": Field("m/s", "velocity innovation north"),
            "IVE": Field("m/s", "velocity innovation east"),
            "IPN": Field("m", "position innovation north"),
            "IPE": Field("m", "position innovation east"),
        },
        ("NKF3", "EKF3", "NKF8"), "C",
    ),
    "XKF4": Message(_TEST_RATIOS, ("NKF4", "EKF4", "NKF9"), "C"),
}  # fmt: skip
_TELEMETRY: Dictionary = {
    "ATTITUDE": Message({
        "roll": Field("rad", "roll"), "pitch": Field("rad", "pitch"), "yaw": Field("rad", "heading")
    }),
    "VFR_HUD": Message({
        "alt": _placed("m", "height"),
        "groundspeed": Field("m/s", "speed over ground"),
        "throttle": Field("%", "throttle"),
        "climb": Field("m/s", "climb rate"),
    }),
    "SYS_STATUS": Message({
        "voltage_battery": Field("mV", "battery voltage"), "current_battery": Field("cA", "battery current"),
    }),
    "GPS_RAW_INT": Message({
        **{name: _placed("", "") for name in ("lat", "lon", "alt")},
        "satellites_visible": Field(label="satellites"),
        "eph": Field(label="horizontal dilution, times 100"),
    }),
    "GLOBAL_POSITION_INT": Message({name: _placed("", "") for name in ("lat", "lon", "alt")}),
    "LOCAL_POSITION_NED": Message({name: _placed("m", "") for name in ("x", "y")}),
    "VIBRATION": Message(_axes("vibration_", "m/s2", "vibration", "xyz")),
    "SERVO_OUTPUT_RAW": Message({f"servo{n}_raw": Field("us", "motor and servo outputs") for n in range(1, 17)}),
}  # fmt: skip

MESSAGES: Dictionary = {**_FLIGHT, **_SENSORS, **_TELEMETRY}


def recorded_as(name: str) -> tuple[str, ...]:
    """The messages that carry a message of today's name or carried it, one an instance."""
    known = MESSAGES.get(name)
    return (name,) if known is None else (name, *known.former)


def former_fields(name: str) -> dict[str, tuple[str, ...]]:
    """Per field of a message what it was called, where that was otherwise."""
    known = MESSAGES.get(name)
    return {} if known is None else {field: spec.former for field, spec in known.fields.items() if spec.former}


def expanded(reads: Wanted) -> dict[str, tuple[str, ...]]:
    """The channels and fields by every name that they may have in a log."""
    wanted: dict[str, tuple[str, ...]] = {}
    for name, fields in reads.items():
        former, known = former_fields(name), MESSAGES.get(name)
        instance = () if known is None or not known.instance else (known.instance, *former.get(known.instance, ()))
        names = _all_names(fields, former)
        for message in recorded_as(name):
            wanted[message] = tuple(dict.fromkeys((*wanted.get(message, ()), *names, *instance)))
    return wanted


def _all_names(fields: Iterable[str], former: Mapping[str, tuple[str, ...]]) -> list[str]:
    return [name for field in fields for name in (field, *former.get(field, ()))]

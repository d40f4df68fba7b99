"""What DataFlash and MAVLink messages mean: units, words, former names, and what says where a vehicle was.

ArduPilot: docs "Log messages" and the FMTU records of its logs; MAVLink: common.xml.
"""

from __future__ import annotations

from collections.abc import Mapping

from care_core.ecosystems.ardupilot.messages import FORMER, INSTANCE
from care_core.ecosystems.dictionary import Dictionary, Field, Message

Words = tuple[str, str]
"""Unit and words."""

_ATTITUDE = {"Roll": ("deg", "roll"), "Pitch": ("deg", "pitch"), "Yaw": ("deg", "heading")}
_ESTIMATOR = {
    "SV": ("", "velocity test ratio of the estimator"),
    "SP": ("", "position test ratio of the estimator"),
    "SH": ("", "height test ratio of the estimator"),
    "SM": ("", "compass test ratio of the estimator"),
}
_BATTERY = {
    "Volt": ("V", "battery voltage"),
    "Curr": ("A", "battery current"),
    "EnrgTot": ("Wh", "energy drawn"),
    "CurrTot": ("mAh", "charge drawn"),
    "Res": ("ohm", "estimated resistance of the battery"),
}
_OUTPUTS = {f"C{number}": ("us", "motor and servo outputs") for number in range(1, 15)}
_SERVOS = {f"servo{number}_raw": ("us", "motor and servo outputs") for number in range(1, 17)}


def _along(axis: str, names: str) -> dict[str, Words]:
    """Position, velocity and acceleration controller of one axis, with its fields' last letter."""
    end = names[-1]
    return {
        f"P{end}": ("m", f"position {axis}"),
        f"V{end}": ("m/s", f"speed {axis}"),
        f"A{end}": ("m/s2", f"acceleration {axis}"),
        f"TA{end}": ("m/s2", f"acceleration {axis} asked for"),
        f"DA{end}": ("m/s2", f"acceleration {axis} planned"),
    }


_WORDS: Mapping[str, Mapping[str, Words]] = {
    "ATT": _ATTITUDE,
    "CTUN": {
        "Alt": ("m", "height"),
        "BarAlt": ("m", "height by the barometer"),
        "CRt": ("cm/s", "climb rate"),
        "ThO": ("", "throttle, 0 to 1"),
        "ThrOut": ("", "throttle"),
    },
    "RATE": {
        "R": ("deg/s", "roll rate"),
        "P": ("deg/s", "pitch rate"),
        "Y": ("deg/s", "yaw rate"),
        "ROut": ("", "roll output, -1 to 1"),
        "POut": ("", "pitch output, -1 to 1"),
        "YOut": ("", "yaw output, -1 to 1"),
    },
    "PSCN": _along("north", "PN"),
    "PSCE": _along("east", "PE"),
    "PSCD": _along("down", "PD"),
    "STER": {
        "TurnRate": ("deg/s", "turn rate"),
        "SteerOut": ("", "steering output"),
        "LatAcc": ("m/s2", "lateral acceleration"),
    },
    "THR": {"Speed": ("m/s", "speed"), "ThrOut": ("%", "throttle output")},
    "BAT": _BATTERY,
    "CURR": {"Volt": ("", "battery voltage"), "Curr": ("", "battery current")},
    "VIBE": {f"Vibe{axis}": ("m/s2", "vibration") for axis in "XYZ"},
    "GPS": {"NSats": ("", "satellites"), "HDop": ("", "horizontal dilution"), "Spd": ("m/s", "speed over ground")},
    "POS": {"RelHomeAlt": ("m", "height above home"), "Alt": ("m", "height above the sea")},
    "RCOU": _OUTPUTS,
    "MOT": {f"Mot{number}": ("us", "motor outputs") for number in range(1, 9)},
    "XKF4": _ESTIMATOR,
    "NKF4": _ESTIMATOR,
    "XKF3": {
        "IVN": ("m/s", "velocity innovation north"),
        "IVE": ("m/s", "velocity innovation east"),
        "IPN": ("m", "position innovation north"),
        "IPE": ("m", "position innovation east"),
    },
    "MAG": {f"Mag{axis}": ("mGauss", "magnetic field") for axis in "XYZ"},
    "BARO": {"Alt": ("m", "height by the barometer"), "Press": ("Pa", "air pressure")},
    "ATTITUDE": {"roll": ("rad", "roll"), "pitch": ("rad", "pitch"), "yaw": ("rad", "heading")},
    "VFR_HUD": {
        "alt": ("m", "height"),
        "groundspeed": ("m/s", "speed over ground"),
        "throttle": ("%", "throttle"),
        "climb": ("m/s", "climb rate"),
    },
    "SYS_STATUS": {"voltage_battery": ("mV", "battery voltage"), "current_battery": ("cA", "battery current")},
    "GPS_RAW_INT": {"satellites_visible": ("", "satellites"), "eph": ("", "horizontal dilution, times 100")},
    "VIBRATION": {f"vibration_{axis}": ("m/s2", "vibration") for axis in "xyz"},
    "SERVO_OUTPUT_RAW": _SERVOS,
}

_POSITIONS = {
    "POS": {"Lat", "Lng", "Alt"},
    "GPS": {"Lat", "Lng", "Alt"},
    "AHR2": {"Lat", "Lng", "Alt"},
    "PSCN": {"PN", "TPN", "DPN"},
    "PSCE": {"PE", "TPE", "DPE"},
    "NTUN": {"DPosX", "DPosY", "PosX", "PosY"},
    "GLOBAL_POSITION_INT": {"lat", "lon", "alt"},
    "GPS_RAW_INT": {"lat", "lon", "alt"},
    "LOCAL_POSITION_NED": {"x", "y"},
    "VFR_HUD": {"alt"},
}
"""Fields that say where on earth, or on the map of its site, the vehicle was."""


def _field(message: str, name: str) -> Field:
    unit, label = _WORDS.get(message, {}).get(name, ("", ""))
    former = FORMER.get(message, {}).get(name, ())
    return Field(unit, label, former, is_position=name in _POSITIONS.get(message, ()))


def _message(name: str) -> Message:
    fields = dict.fromkeys((*_WORDS.get(name, ()), *_POSITIONS.get(name, ()), *FORMER.get(name, ())))
    return Message({field: _field(name, field) for field in fields}, instance=next(iter(INSTANCE.get(name, ())), ""))


DICTIONARY: Dictionary = {name: _message(name) for name in dict.fromkeys((*_WORDS, *_POSITIONS, *FORMER, *INSTANCE))}
"""By today's names; messages of older firmware stand under their own."""

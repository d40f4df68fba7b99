"""Which vehicle a log is of, by what the log says of it and by its parameters."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Literal

from care_core.ecosystems.vehicles.frames import CLASSES, TYPES, frame_of
from care_core.ecosystems.vehicles.self_written import SIMULATOR_PREFIX
from care_core.ecosystems.vehicles.settings import Driven, code
from care_core.records import Record
from care_core.run import Run

Kind = Literal[
    "copter", "plane", "quadplane", "rover", "sub", "heli", "tracker", "blimp", "px4", "unknown"
]  # fmt: skip
"""Which firmware flies it, hence whose mode numbers and checks count."""

_FIRMWARE = re.compile(r"(?:Ardu|APM:)?(Copter|Plane|Rover|Sub|AntennaTracker|Tracker|Blimp)\b", re.IGNORECASE)
_KINDS: Mapping[str, Kind] = {
    "copter": "copter", "plane": "plane", "rover": "rover", "sub": "sub", "antennatracker": "tracker",
    "tracker": "tracker", "blimp": "blimp",
}  # fmt: skip
_OWN_NAME = re.compile(r".*, which is ")
_VERSION = re.compile(r"[Vv ](\d+)\.(\d+)(?:\.(\d+))?")
_ONLY_ITS: Mapping[Kind, tuple[str, ...]] = {
    "copter": ("LAND_SPEED", "LAND_SPD_MS", "SIMPLE", "SUPER_SIMPLE", "RTL_CONE_SLOPE", "PHLD_BRAKE_RATE"),
    "plane": ("TRIM_THROTTLE", "STALL_PREVENTION", "THR_SLEWRATE", "KFF_RDDRMIX", "WP_LOITER_RAD"),
    "rover": ("CRUISE_SPEED", "CRUISE_THROTTLE", "TURN_RADIUS", "TURN_MAX_G", "MODE_CH"),
    "sub": ("JS_GAIN_DEFAULT", "JS_GAIN_MAX", "SURFACE_DEPTH", "JS_LIGHTS_STEPS"),
    "tracker": ("YAW2SRV_P", "ONOFF_YAW_RATE", "ONOFF_PITCH_RATE", "PITCH2SRV_P"),
}  # fmt: skip
"""Parameters of one vehicle alone, in most of its releases; two of them tell it."""
_HELI_CLASSES = frozenset((6, 11, 13))
_HELI_ONLY = "H_SV1_POS", "H_SV_1_POS", "H_SWASH_TYPE", "H_SW_TYPE", "H_COL_MIN"
"""Parameters of the swash plate: only the firmware built for helicopters has any (AP_MotorsHeli, of every age)."""
_ROVER_CLASSES = {2: "boat", 3: "balance bot"}
UNLIKE_ROVERS = frozenset(_ROVER_CLASSES.values())
"""What Rover's firmware drives as well."""
_MAV_TYPES = {
    1: "fixed wing", 2: "quad", 3: "coaxial copter", 4: "helicopter", 7: "airship", 10: "rover", 11: "boat",
    12: "submarine", 13: "hexa", 14: "octa", 15: "tricopter", **dict.fromkeys(range(19, 26), "VTOL"),
}  # fmt: skip
"""MAV_TYPE of PX4, which its airframes set."""
_SUB_FRAMES = {
    0: "BlueROV1", 1: "vectored", 2: "vectored, 6 axes", 3: "vectored, 6 axes, thrusters at 90 degrees",
    4: "3 thrusters", 5: "4 thrusters", 6: "5 thrusters",
}  # fmt: skip


_GROUNDED = frozenset(("rover", "sub", "tracker"))
_GROUNDED_TYPES = frozenset(("rover", "boat", "submarine"))


def flies(kind: Kind, type: str = "") -> bool:
    """Whether a vehicle leaves the ground; one that is unknown may, unless its log says of what type it is."""
    return kind not in _GROUNDED and type not in _GROUNDED_TYPES


def is_simulated(facts: Mapping[str, str], settings: Driven) -> bool:
    """Whether the log says that a simulator flew it: only ArduPilot's builds of it have parameters of the simulation,
    and PX4's name themselves as the hardware. A board with PX4 has some of those parameters, too; SYS_HITL says that
    it flies in a simulator, of another computer (1) or of its own (2)."""
    if facts.get("stack") == "PX4":
        return "SITL" in facts.get("hardware", "") or code(settings, "SYS_HITL") in (1, 2)
    return any(name.startswith(SIMULATOR_PREFIX) for name in settings)


class Vehicle(Record):
    """What a vehicle is."""

    kind: Kind
    name: str
    """In words: "quad X", "quadplane", "boat"."""
    firmware: str
    """As the log names it, "" where it does not: "ArduCopter V4.5.4 (fd1bcc61)"."""
    version: tuple[int, ...] | None
    """Major, minor and, where it is told, patch number of the firmware."""

    @property
    def title(self) -> str:
        """Firmware without its commit, and name: "ArduCopter V4.5.4, quad X"."""
        firmware = re.sub(r"\s*\([0-9a-f]{6,}\)", "", self.firmware).strip()
        return ", ".join(part for part in (firmware, self.name) if part)


def vehicle_of(facts: Mapping[str, str], settings: Driven, motors: int | None = None) -> Vehicle:
    """The vehicle of a log.

    Args:
        facts: what the log says of its robot (`firmware`, `vehicle`, `frame`, `stack`).
        settings: its parameters.
        motors: how many motor outputs the log records; firmware before 3.5 was built for one class of frame and has no
            parameter that names it.
    """
    firmware = facts.get("firmware", "")
    own = _OWN_NAME.sub("", firmware)
    kind = _kind(own, facts, settings)
    return Vehicle(kind, _name(kind, facts, settings, motors), firmware, _version(own))


def vehicle_of_run(run: Run) -> Vehicle:
    """The vehicle of a run that was read."""
    return vehicle_of(run.log.facts, {name: (setting,) for name, setting in run.settings.items()})


def _kind(firmware: str, facts: Mapping[str, str], settings: Driven) -> Kind:
    if facts.get("stack") == "PX4" or firmware.startswith("PX4"):
        return "px4"
    match = _FIRMWARE.match(firmware)
    kind = _KINDS[match[1].casefold()] if match else _by_parameters(settings)
    if kind == "copter" and (
        facts.get("vehicle") == "helicopter"
        or code(settings, "FRAME_CLASS") in _HELI_CLASSES
        or any(name in settings for name in _HELI_ONLY)
    ):
        return "heli"
    if kind == "plane" and (facts.get("vehicle") == "VTOL" or code(settings, "Q_ENABLE") in (1, 2)):
        return "quadplane"
    return kind


def _by_parameters(settings: Driven) -> Kind:
    """The kind whose own parameters are there, where none of another's is."""
    counts = {kind: sum(name in settings for name in names) for kind, names in _ONLY_ITS.items()}
    there = [kind for kind, count in counts.items() if count]
    return there[0] if len(there) == 1 and counts[there[0]] > 1 else "unknown"


def _name(kind: Kind, facts: Mapping[str, str], settings: Driven, motors: int | None) -> str:
    if kind == "copter":
        return _copter(facts, settings, motors)
    if kind == "rover":
        return _ROVER_CLASSES.get(code(settings, "FRAME_CLASS") or 0, facts.get("vehicle", "") or "rover")
    if kind == "sub":
        frame = _SUB_FRAMES.get(-1 if (chosen := code(settings, "FRAME_CONFIG")) is None else chosen, "")
        return f"submarine, {frame}" if frame else "submarine"
    if kind == "px4" and code(settings, "MAV_TYPE") in _MAV_TYPES:
        return _MAV_TYPES[code(settings, "MAV_TYPE") or 0]
    if kind in ("unknown", "px4"):
        return facts.get("vehicle", "") or "unknown vehicle"
    return {"plane": "fixed wing", "heli": "helicopter", "tracker": "antenna tracker"}.get(kind, kind)


def _copter(facts: Mapping[str, str], settings: Driven, motors: int | None) -> str:
    frame_class, frame_type = frame_of(settings, motors)
    name = CLASSES.get(frame_class or 0, "")
    if not name:
        return facts.get("frame", "").replace("/", " ").casefold() or "multicopter"
    shape = TYPES.get(frame_type, "") if frame_type is not None else ""
    return f"{name} {shape}".strip()


def _version(firmware: str) -> tuple[int, ...] | None:
    """The version of a firmware by its own name: a vendor counts as it likes."""
    named = firmware.startswith("PX4") or _FIRMWARE.match(firmware)
    match = _VERSION.search(firmware) if named else None
    return tuple(int(part) for part in match.groups() if part is not None) if match else None

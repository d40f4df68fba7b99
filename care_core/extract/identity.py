"""Which robot a log is of, as the log itself says it: the one place where that is decided.

What a recorder noted and what names one device (the serial of the board) come before what people set (a system id, a
name space), for that is often left as it was delivered. Where nothing names a robot, none is guessed.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping

from care_core.ecosystems.vehicles.settings import code
from care_core.ecosystems.vehicles.vehicle import vehicle_of
from care_core.logs.base import Log, LogFormat
from care_core.run import Robot, Setting
from care_core.text import clean

_NOTES = (
    "robot", "robot_name", "robot_id", "serial", "serial_number", "vehicle_id", "vehicle_name", "vin", "hostname",
    "host", "device", "device_name", "device_id", "machine",
)  # fmt: skip
"""Last words of keys under which recorders and parameters name a robot, the surest kind first."""
_NO_NAME = frozenset(("", "none", "unknown", "default", "localhost", "robot", "0"))
_LONGEST = 60

_SAID = {"MSG": ("Message",), "STATUSTEXT": ("text",), "AUTOPILOT_VERSION": ("uid2",)}
# ArduPilot says its board and the 96 bits that its processor was made with (AP_HAL_ChibiOS/Util.cpp:
# get_system_id); on Linux and in simulation it says the machine's id, whose first byte counts instances up
# (AP_HAL_SITL/Util.cpp), so it need not be a hexadecimal digit.
_BOARD = re.compile(r"(?:(?P<board>\S.{0,40}) )?(?P<serial>[0-9A-F]{8} [0-9A-F]{8} [0-9A-F]{8})")
_MACHINE = re.compile(r"[!-~][0-9a-f]{31}")
_UID_BYTES, _SERIAL_BYTES = 18, 12
"""AUTOPILOT_VERSION.uid2 holds the same: the processor's bytes and zeros, or the first letters of the machine's id."""
_SERIALS = ("BRD_SERIAL_NUM",)
"""Numbers that the owner gives a vehicle; 0 and below where none was given."""
_SYSTEMS = ("SYSID_THISMAV", "MAV_SYSID", "MAV_SYS_ID")
"""Of ArduPilot to 4.6, ArduPilot from 4.7 on, PX4."""
_DELIVERED = 1
"""The system id that every vehicle comes with, so it tells none from another."""

_MOVES = ("nav_msgs/Odometry", "geometry_msgs/Twist", "geometry_msgs/TwistStamped")
_NO_ROBOT = ("controller", "server", "base", "filter")
"""How name spaces of software end."""
_DESCRIPTION = "/robot_description"
_URDF_NAME = re.compile(r"<robot\b[^>]*?\bname\s*=\s*[\"']([^\"']+)[\"']")
_URDF_HEAD = 4000


def robot_of(log: Log) -> str | None:
    """A name that all logs of this robot have and no other robot's; None where the log gives none."""
    robot = identify(log)
    return robot.id if robot is not None and robot.is_sure else None


def identify(log: Log) -> Robot | None:
    """The robot of a log, by the best that the log says of it; None where it says nothing."""
    return next(_names(log), None)


def named(name: str) -> Robot:
    """The robot that the operator names."""
    return Robot(clean(name.strip()), clean(name.strip()), "named by the operator", is_sure=True)


def _names(log: Log) -> Iterator[Robot]:
    yield from _under_a_name(log.facts.items(), "what the recorder noted")
    if log.format in (LogFormat.ROS1_BAG, LogFormat.ROS2_DB3, LogFormat.MCAP):
        yield from _of_ros(log)
    else:
        yield from _of_vehicle(log)


def _under_a_name(pairs: Iterable[tuple[str, object]], source: str) -> Iterator[Robot]:
    found: dict[str, Robot] = {}
    for key, value in pairs:
        word = re.split(r"[./]", key.casefold())[-1]
        text = clean(value.strip()) if isinstance(value, str) else ""
        if word in _NOTES and text.casefold() not in _NO_NAME and len(text) <= _LONGEST:
            found.setdefault(word, Robot(text, text, f"{source}, {clean(key)}", is_sure=True))
    yield from (found[word] for word in _NOTES if word in found)


# ArduPilot and PX4


def _of_vehicle(log: Log) -> Iterator[Robot]:
    facts, settings = log.facts, log.settings()
    if uuid := facts.get("uuid", "").strip("0") and clean(facts["uuid"]):
        short = uuid[:8] if len(uuid) == 2 * _SERIAL_BYTES else uuid[-8:]  # the chip's place on its wafer
        yield Robot(uuid, f"{clean(facts.get('hardware', 'PX4'))} {short}", "sys_uuid", is_sure=True)
    for name, table in log.read(_SAID).items():
        columns = (table.columns.get(field, ()) for field in _SAID[name])
        yield from (robot for column in columns for value in column if (robot := _board(value)) is not None)
    for name in _SERIALS:
        if (serial := code(settings, name) or 0) > 0:
            yield Robot(f"serial {serial}", f"serial {serial}", name, is_sure=True)
    told = (number for name in _SYSTEMS if (number := code(settings, name)))
    system = facts.get("system", "").partition(".")[0]
    number = next(told, int(system) if system.isdecimal() else 0)
    if number > _DELIVERED:
        yield Robot(f"system {number}", f"system {number}", "system id", is_sure=True)
    if number:
        kind = vehicle_of(facts, settings).kind
        name = f"{'vehicle' if kind == 'unknown' else kind} {number}"
        yield Robot(name, name, "system id as delivered", is_sure=False)


def _board(said: object) -> Robot | None:
    """The board or machine that a text, or the bytes of uid2, name."""
    if isinstance(said, str):
        if match := _BOARD.fullmatch(said.strip()):
            return _of_serial(match["serial"], match["board"] or "board")
        return _of_machine(said.strip()) if _MACHINE.fullmatch(said.strip()) else None
    if not isinstance(said, (tuple, list)) or len(said) != _UID_BYTES:
        return None
    raw = bytes(int(value) & 0xFF for value in said)
    if any(raw[:_SERIAL_BYTES]) and not any(raw[_SERIAL_BYTES:]):
        words = raw[:_SERIAL_BYTES].hex(" ", 4).upper()
        return _of_serial(words, "board")
    text = raw.decode("ascii", "replace")
    return _of_machine(text) if re.fullmatch(r"[!-~][0-9a-f]{17}", text) else None


def _of_serial(words: str, board: str) -> Robot:
    return Robot(words, f"{clean(board)} {words.partition(' ')[0]}", "serial of the board", is_sure=True)


def _of_machine(text: str) -> Robot:
    id = clean(text[:_UID_BYTES])
    return Robot(id, f"machine {id[:8]}", "id of the machine", is_sure=True)


# ROS


def _of_ros(log: Log) -> Iterator[Robot]:
    settings = log.settings()
    yield from _under_a_name(((name, history[-1].value) for name, history in settings.items()), "parameter")
    moved = (channel.name.strip("/") for channel in log.channels() if channel.type.replace("/msg/", "/") in _MOVES)
    roots = {name.rpartition("/")[0].partition("/")[0] for name in moved}
    if len(roots) == 1 and (root := clean(roots.pop())) and not root.endswith(_NO_ROBOT):
        has_number = any(character.isdigit() for character in root)
        yield Robot(root, root, "name space of the topics", is_sure=has_number)
    yield from _described(log, settings)


def _described(log: Log, settings: Mapping[str, tuple[Setting, ...]]) -> Iterator[Robot]:
    """The model's name in the robot's description: robots of one model share it."""
    told = settings.get(_DESCRIPTION)
    texts = [] if told is None else [told[-1].value]
    table = log.read({_DESCRIPTION: ("data",)}).get(_DESCRIPTION) if not texts else None
    if table is not None and "data" in table.columns:
        texts = list(table["data"][:1])
    for text in texts:
        match = _URDF_NAME.search(str(text)[:_URDF_HEAD])
        if match:
            name = clean(match[1])[:_LONGEST]
            yield Robot(name, name, "name of the model", is_sure=False)

"""Which vehicle an ArduPilot or PX4 log is of: the serial of its board, the number its owner gave it, its system id."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from care_core.ecosystems.vehicles.settings import code
from care_core.ecosystems.vehicles.vehicle import is_simulated, vehicle_of
from care_core.logs.base import Log
from care_core.records import replace
from care_core.run import Robot, Setting
from care_core.text import clean

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
_SENSORS = ("INS_ACC_ID", "INS_GYR_ID", "INS1_ACC_ID", "INS4_ACC_ID")
_BUS, _SIMULATED_BUS = 7, 4
"""The lowest bits of a sensor's id are its bus, and one bus is that of a simulator (AP_HAL/Device.h: BUS_TYPE_SITL)."""
_DELIVERED = 1
"""The system id that every vehicle comes with, so it tells none from another."""


def robots(log: Log) -> Iterator[Robot]:
    """What tells this vehicle from others, the surest first."""
    facts, settings = log.facts, log.settings()
    if uuid := facts.get("uuid", "").strip("0") and clean(facts["uuid"]):
        short = uuid[:8] if len(uuid) == 2 * _SERIAL_BYTES else uuid[-8:]  # the chip's place on its wafer
        yield Robot(uuid, f"{clean(facts.get('hardware', 'PX4'))} {short}", "sys_uuid", is_sure=True)
    for name, table in log.read(_SAID).items():
        columns = (table.columns.get(field, ()) for field in _SAID[name])
        boards = (robot for column in columns for value in column if (robot := _board(value)) is not None)
        yield from map(_simulated, boards) if _has_simulated_sensors(settings) else boards
    for name in _SERIALS:
        if (serial := code(settings, name) or 0) > 0:
            yield Robot(f"serial {serial}", f"serial {serial}", name, is_sure=True)
    told = (number for name in _SYSTEMS if (number := code(settings, name)))
    system = facts.get("system", "").partition(".")[0]
    number = next(told, int(system) if system.isdecimal() else 0)
    if number > _DELIVERED:
        # PX4's simulator counts its instances up: the next vehicle of this machine has the same number
        counted = facts.get("stack") == "PX4" and is_simulated(facts, settings)
        yield Robot(f"system {number}", f"system {number}", "system id", is_sure=True, is_simulated=counted)
    if number:
        kind = vehicle_of(facts, settings).kind
        name = f"{'vehicle' if kind == 'unknown' else kind} {number}"
        yield Robot(name, name, "system id as delivered", is_sure=False)


def _has_simulated_sensors(settings: Mapping[str, tuple[Setting, ...]]) -> bool:
    """Whether the sensors are a simulator's."""
    ids = (code(settings, name) for name in _SENSORS)
    return any(id & _BUS == _SIMULATED_BUS for id in ids if id)


def _simulated(robot: Robot) -> Robot:
    return replace(robot, source="id of the machine that simulates it", is_simulated=True)


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

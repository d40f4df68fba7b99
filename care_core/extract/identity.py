"""Which robot a log is of, as the log itself says it: the one place where that is decided."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from care_core.logs.base import Log, LogFormat
from care_core.run import Setting
from care_core.text import clean

# ArduPilot says its board and the 96 bits that its processor was made with (AP_HAL_ChibiOS/Util.cpp:
# get_system_id); on Linux and in simulation it says the machine's id, whose first byte counts instances up
# (AP_HAL_SITL/Util.cpp), so it need not be a hexadecimal digit.
_BOARD = re.compile(r"(?:\S.{0,40} )?[0-9A-F]{8} [0-9A-F]{8} [0-9A-F]{8}")
_MACHINE = re.compile(r"[!-~][0-9a-f]{31}")
_TEXTS = {"MSG": ("Message",), "STATUSTEXT": ("text",)}

_SERIALS = ("BRD_SERIAL_NUM",)
"""Numbers that the owner gives a vehicle; 0 and below where none was given."""
_SYSTEMS = ("SYSID_THISMAV", "MAV_SYSID", "MAV_SYS_ID")
"""Vehicles come with number 1, so 1 tells none from another."""
_NOTES = ("robot", "robot_name", "robot_id", "serial", "serial_number", "uuid", "hostname", "host")
"""What those write who record a robot's name beside its messages."""
_ARDUPILOT = (LogFormat.DATAFLASH_BIN, LogFormat.DATAFLASH_TEXT, LogFormat.MAVLINK_TLOG)


def robot_of(log: Log) -> str | None:
    """A name that all logs of this robot have and no other robot's: its serial, its system id or its host; None where
    the log names none."""
    return next((clean(name.strip()) for name in _names(log) if name.strip()), None)


def _names(log: Log) -> Iterator[str]:
    facts = {key.casefold(): value for key, value in log.facts.items()}
    yield from (facts[note] for note in _NOTES if note in facts)
    if log.format in _ARDUPILOT:
        for table in log.read(_TEXTS).values():
            texts = (str(text) for column in table.columns.values() for text in column)
            yield from (text for text in texts if _BOARD.fullmatch(text) or _MACHINE.fullmatch(text))
    settings = log.settings()
    yield from (f"serial {number}" for number in _numbers(settings, _SERIALS, above=0))
    yield from (f"system {number}" for number in _numbers(settings, _SYSTEMS, above=1))
    system = facts.get("system", "").partition(".")[0]
    if system.isdecimal() and int(system) > 1:
        yield f"system {system}"


def _numbers(settings: Mapping[str, tuple[Setting, ...]], names: tuple[str, ...], above: int) -> Iterator[int]:
    values = (settings[name][-1].value for name in names if name in settings)
    yield from (int(value) for value in values if isinstance(value, (int, float)) and value > above)

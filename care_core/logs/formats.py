"""The formats of logs that can be read: one row each. A new format is its reader's module and a row here."""

from __future__ import annotations

import re
from collections.abc import Callable

from care_core.records import Record

SNIFF_BYTES = 4096
"""How much of a file is looked at to tell its format."""

_TEXT_FORMAT = re.compile(rb"(?m)^FMT, ?\d+, ?\d+, ?\w+")
_MAVLINK_MARKERS = (0xFD, 0xFE)
_PRINTED = re.compile(rb"[\t\r\n -~]+")


class LogFormat(Record):
    """A format of logs: what it is called, whose it is, how a file of it is told, and what reads it."""

    name: str
    """As profiles and reports have it: `px4-ulg`."""
    title: str
    """As operators call such logs: "PX4 ULog"."""
    ecosystem: str
    """The name of the ecosystem whose logs they are."""
    reader: tuple[str, str]
    """Module and class, imported when the first log of the format is opened."""
    suffixes: tuple[str, ...]
    """How names of such files end, the usual ending first."""
    magic: bytes = b""
    """How such a file begins; empty where only `looks_like` tells."""
    looks_like: Callable[[bytes], bool] | None = None
    """Whether a file is one, by its first bytes. Asked where no file's magic fits."""
    may_be_packed: bool = False
    """Whether the reader unpacks zstd by itself."""
    missing_hint: str = ""
    """What to do about a channel that a log of this format lacks; empty: what its ecosystem says."""
    clock_hint: str = "judge a log whose messages carry the time at which they were recorded"
    """What to do about times that cannot be right."""


def is_raw_mavlink(head: bytes) -> bool:
    """Whether a file is a stream of MAVLink packets without the time stamps of a ground station (.rlog, .tlog.raw). A
    vehicle that starts may print text between them."""
    if _frame_is_followed(head, 0, stamp=0):
        return True
    end = _frame_end(head, 0)
    printed = None if end is None else _PRINTED.match(head, end)
    return printed is not None and _frame_is_followed(head, printed.end(), stamp=0)


def _is_dataflash(head: bytes) -> bool:
    """A DataFlash log declares its message types first; damage at its very start must not hide them."""
    return b"\xa3\x95\x80" in head


def _is_dataflash_text(head: bytes) -> bool:
    return _TEXT_FORMAT.search(head) is not None


def _is_mavlink(head: bytes) -> bool:
    is_lone_packet = len(head) > 8 and head[0] == 0 and head[8] in _MAVLINK_MARKERS
    return (
        is_raw_mavlink(head)
        or is_lone_packet
        or any(_frame_is_followed(head, at + 8) for at in range(len(head) - 8) if head[at] == 0)
    )


def _frame_end(head: bytes, at: int) -> int | None:
    """Where a MAVLink packet ends that begins here; None where none does."""
    if at + 3 > len(head) or head[at] not in _MAVLINK_MARKERS:
        return None
    is_v2 = head[at] == 0xFD
    if is_v2 and head[at + 2] & ~1:
        return None
    return at + head[at + 1] + (12 + 13 * head[at + 2] if is_v2 else 8)


def _frame_is_followed(head: bytes, at: int, stamp: int = 8) -> bool:
    """Whether a MAVLink packet begins here, and after it and a stamp of this many bytes the next, or the file's end."""
    end = _frame_end(head, at)
    if end is None:
        return False
    follows = end + stamp < len(head) and head[end + stamp] in _MAVLINK_MARKERS
    return follows or (len(head) < SNIFF_BYTES and len(head) - 8 <= end <= len(head))


DATAFLASH_BIN = LogFormat(
    name="dataflash-bin",
    title="ArduPilot DataFlash",
    ecosystem="ardupilot",
    reader=("care_core.logs.dataflash", "DataFlashLog"),
    suffixes=(".BIN",),
    looks_like=_is_dataflash,
)
DATAFLASH_TEXT = LogFormat(
    name="dataflash-text",
    title="ArduPilot DataFlash",
    ecosystem="ardupilot",
    reader=("care_core.logs.dataflash_text", "DataFlashTextLog"),
    suffixes=(".log",),
    looks_like=_is_dataflash_text,
)
MAVLINK_TLOG = LogFormat(
    name="mavlink-tlog",
    title="MAVLink telemetry",
    ecosystem="ardupilot",
    reader=("care_core.logs.mavlink", "MavlinkLog"),
    suffixes=(".tlog",),
    looks_like=_is_mavlink,
    missing_hint="telemetry does not carry it: use the .BIN (PX4: the .ulg) of the vehicle's memory card",
    clock_hint="telemetry has the ground station's times, and a simulator runs at its own pace: use the .BIN (PX4: the"
    " .ulg) that the vehicle wrote",
)
PX4_ULG = LogFormat(
    name="px4-ulg",
    title="PX4 ULog",
    ecosystem="px4",
    reader=("care_core.logs.px4_ulog", "Px4Log"),
    suffixes=(".ulg",),
    magic=b"ULog\x01\x12\x35",
)
ROS1_BAG = LogFormat(
    name="ros1-bag",
    title="ROS 1 bags",
    ecosystem="ros",
    reader=("care_core.logs.ros1_bag", "Ros1Bag"),
    suffixes=(".bag", ".active"),
    magic=b"#ROSBAG V2.0",
    may_be_packed=True,
)
ROS2_DB3 = LogFormat(
    name="ros2-db3",
    title="ROS 2 bags",
    ecosystem="ros",
    reader=("care_core.logs.ros2_db3", "Ros2Db3"),
    suffixes=(".db3", ".zstd"),
    magic=b"SQLite format 3\0",
    may_be_packed=True,
)
MCAP = LogFormat(
    name="mcap",
    title="ROS 2 bags",
    ecosystem="ros",
    reader=("care_core.logs.mcap_log", "McapLog"),
    suffixes=(".mcap",),
    magic=b"\x89MCAP0\r\n",
    may_be_packed=True,
)

FORMATS: tuple[LogFormat, ...] = (DATAFLASH_BIN, DATAFLASH_TEXT, MAVLINK_TLOG, PX4_ULG, ROS1_BAG, ROS2_DB3, MCAP)


def format_named(name: str) -> LogFormat:
    """The format that a profile or report names. Raises KeyError where there is none."""
    found = next((format for format in FORMATS if format.name == name), None)
    if found is None:
        raise KeyError(name)
    return found


def readable() -> str:
    """The formats that can be read, in words: "PX4 ULog (.ulg), ROS 2 bags (.db3, .mcap)"."""
    endings: dict[str, list[str]] = {}
    for format in FORMATS:
        endings.setdefault(format.title, []).append(format.suffixes[0])
    *first, last = (f"{title} ({', '.join(suffixes)})" for title, suffixes in endings.items())
    return f"{', '.join(first)} and {last}"


def log_suffixes() -> tuple[str, ...]:
    """How the names of logs end, in small letters."""
    return tuple(suffix.lower() for format in FORMATS for suffix in format.suffixes)

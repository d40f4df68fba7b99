"""The logs that a profile is made from."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

from care_core.ecosystems.registry import run_model
from care_core.logs.base import Log, LogFormat
from care_core.logs.opening import open_log
from care_core.records import Record
from care_core.run import Setting

Ecosystem = Literal["ardupilot", "px4", "ros1", "ros2"]

_ARDUPILOT = (LogFormat.DATAFLASH_BIN, LogFormat.DATAFLASH_TEXT, LogFormat.MAVLINK_TLOG)


class Seen(Record, eq=False):
    """A log as far as a profile is made of it."""

    path: Path
    log: Log
    settings: Mapping[str, tuple[Setting, ...]]
    channels: Mapping[str, str]
    """Those that hold a message, with their types."""

    @property
    def ecosystem(self) -> Ecosystem:
        if self.log.format in _ARDUPILOT:
            return "ardupilot"
        if self.log.format is LogFormat.PX4_ULG:
            return "px4"
        return "ros1" if self.log.facts.get("ros") == "1" else "ros2"


def see(path: Path) -> Seen:
    """Open a log. Raises LogError."""
    log = open_log(path)
    held = {channel.name: channel.type for channel in run_model(log).log.channels() if channel.count}
    return Seen(path, log, log.settings(), held)

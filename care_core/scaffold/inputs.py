"""The logs that a profile is made from."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from care_core.ecosystems.registry import ecosystem_of, run_model
from care_core.logs.base import Log
from care_core.logs.opening import open_log
from care_core.records import Record
from care_core.run import Setting


class InputLog(Record, eq=False):
    """A log as far as a profile is made of it."""

    path: Path
    opened: Log
    settings: Mapping[str, tuple[Setting, ...]]
    channels: Mapping[str, str]
    """Those that hold a message, with their types."""

    @property
    def stack(self) -> str:
        """Whose parameters it holds: `ardupilot`, `px4`, `ros1`, `ros2`."""
        return ecosystem_of(self.opened.format).stack(self.opened.facts)


def open_input(path: Path) -> InputLog:
    """Open a log. Raises LogError."""
    log = open_log(path)
    channels = {channel.name: channel.type for channel in run_model(log).log.channels() if channel.count}
    return InputLog(path, log, log.settings(), channels)

"""What happened in a log, whatever wrote it: the one door to the health of a log. Needs no profile.

Each ecosystem is one entry: a module with `examine(log) -> Health` that reads the log once.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module

from care_core.ecosystems.findings import TOO_SHORT, WHOLE_LOG, Finding, Health
from care_core.logs.base import Log, LogFormat
from care_core.records import replace

_ARDUPILOT, _PX4 = "care_core.ecosystems.ardupilot.examining", "care_core.ecosystems.px4.examining"
_ROS = "care_core.ecosystems.ros.examining"
ECOSYSTEMS: Mapping[LogFormat, str] = {
    LogFormat.DATAFLASH_BIN: _ARDUPILOT,
    LogFormat.DATAFLASH_TEXT: _ARDUPILOT,
    LogFormat.MAVLINK_TLOG: _ARDUPILOT,
    LogFormat.PX4_ULG: _PX4,
    LogFormat.ROS1_BAG: _ROS,
    LogFormat.ROS2_DB3: _ROS,
    LogFormat.MCAP: _ROS,
}
"""Format of a log -> the module that looks at it, imported only then."""


def examine(log: Log) -> Health:
    """Account and findings of a log; nothing of either where nobody knows what its messages mean."""
    module = ECOSYSTEMS.get(log.format)
    if module is None:
        return Health("", (), (), TOO_SHORT)
    health: Health = import_module(module).examine(log)
    if health.findings or not health.too_little:
        return health
    # An answer too: whoever reads the findings must not take none for fine.
    nothing = Finding(
        "log",
        health.too_little,
        0.0,
        log.duration_s,
        "info",
        f"{log.duration_s:.1f} s of log",
        WHOLE_LOG,
        "world",
    )
    return replace(health, findings=(nothing,))

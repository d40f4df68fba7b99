"""How to record a channel that a log lacks: what to say beside "no BAT in the log"."""

from __future__ import annotations

_ATTITUDE = ("attitude", 1 | 2)
_BITS: dict[str, tuple[str, int]] = {
    "ATT": _ATTITUDE,
    "RATE": _ATTITUDE,
    "POS": _ATTITUDE,
    "GPS": ("GPS", 4),
    "CTUN": ("control tuning", 16),
    "PSCN": ("navigation tuning", 32),
    "PSCE": ("navigation tuning", 32),
    "PSCD": ("navigation tuning", 32),
    "RCIN": ("RC input", 64),
    "IMU": ("IMU", 128),
    "VIBE": ("IMU", 128),
    "CMD": ("mission commands", 256),
    "BAT": ("battery monitor", 512),
    "RCOU": ("RC output", 1024),
    "PIDR": ("PID", 4096),
    "PIDP": ("PID", 4096),
    "PIDY": ("PID", 4096),
    "MAG": ("compass", 8192),
    "MOTB": ("motors", 131072),
}
"""DataFlash message -> the bits of ArduCopter's LOG_BITMASK that have it written, by name and value."""


def how_to_record(channel: str) -> str:
    """What to do before the next run to have a topic (it begins with a slash) or a DataFlash message in the log."""
    if "/_" in channel:
        return f"ros2 bag record --include-hidden-topics {channel}"
    if channel.startswith("/"):
        return f"record it: rosbag record {channel}, or ros2 bag record {channel}"
    message = channel.partition(" ")[0]
    if message in _BITS:
        name, value = _BITS[message]
        return f"set '{name}' ({value}) in LOG_BITMASK, so that the vehicle writes {channel}"
    return f"record {channel}"

"""Which bits of LOG_BITMASK have a DataFlash message written."""

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
    """What to set so that the vehicle writes a message, "" where no bit is known for it."""
    message = channel.partition(" ")[0]
    if message not in _BITS:
        return ""
    name, value = _BITS[message]
    return f"set '{name}' ({value}) in LOG_BITMASK, so that the vehicle writes {channel}"

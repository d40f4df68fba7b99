"""Topics that fall silent while the rest of the robot is recorded on."""

from __future__ import annotations

from care_core.ecosystems.ros.recording import Recording

SILENT_S, SILENT_PERIODS = 5.0, 10.0
"""A stream has ended when it is silent for so long and for so many of its periods."""


def ends_early(recording: Recording, topic: str) -> tuple[float, float] | None:
    """When a stream was heard last and its period, s; None where it goes on to the end, or nothing goes on after it."""
    period_s = recording.streams.get(topic)
    if period_s is None:
        return None
    last_s = float(recording.times[topic][-1])
    silent_s = recording.duration_s - last_s
    if silent_s < max(SILENT_S, SILENT_PERIODS * period_s):
        return None
    others = (recording.times[name][-1] for name in recording.streams if name != topic)
    return (last_s, period_s) if any(recording.duration_s - end < silent_s / 2 for end in others) else None

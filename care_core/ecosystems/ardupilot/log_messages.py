"""Everything that an ArduPilot vehicle said: its texts, and its errors and events in words."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.findings import Event
from care_core.ecosystems.vehicles import error_words, event_words, is_over


def log_messages(flight: Flight) -> Iterator[Event]:
    """Texts, errors and events."""
    for t, text in flight.messages:
        yield Event(t, "message", text, "MSG")
    for t, subsystem, code in flight.error_records:
        over = is_over(subsystem, code)
        yield Event(t, "over" if over else "ERR", error_words(subsystem, code, flight.mode_kind), "ERR")
    for t, number in flight.event_records:
        yield Event(t, "event", event_words(number), "EV")

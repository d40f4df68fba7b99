"""Loss of the radio or of the ground station, as the firmware's failsafes saw it."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.findings import Finding, Severity
from care_core.logs.base import Wanted

READS: Wanted = {}

_LINKS = {5: "the radio link was lost", 8: "the ground station link was lost"}
_WORDS = {5: ("radio failsafe", "throttle failsafe"), 8: ("gcs failsafe",)}
_BRIEF_S = 1.0


def find(flight: Flight) -> Iterator[Finding]:
    """Each link with how long it was gone; one that came back within a second does not explain a crash."""
    for subsystem, title in _LINKS.items():
        told = flight.errors(subsystem)
        gone = [t for t, code in told if code > 0]
        gone += [t for t, text in flight.messages if text.casefold().startswith(_WORDS[subsystem]) and
                 "clear" not in text.casefold()]  # fmt: skip
        gone = sorted(t for t in gone if any(start <= t <= end for start, end in flight.watched))
        if not gone:
            continue
        back = [t for t, code in told if code == 0 and t > gone[0]]
        end = back[0] if back else flight.watched[-1][1]
        away = end - gone[0]
        severity: Severity = "warning" if away < _BRIEF_S or subsystem == 8 else "critical"
        if not flight.armed:
            severity = "info"  # a transmitter that is switched off on the ground
        yield Finding(
            kind="radio",
            title=title,
            onset_s=gone[0],
            end_s=end,
            severity=severity,
            evidence=f"failsafe at {gone[0]:.1f} s, " + (f"back after {away:.1f} s" if back else "not back"),
            source=f"ERR {subsystem}",
            suspect="world",
            probability=0.3 if away < _BRIEF_S else 0.8,
        )

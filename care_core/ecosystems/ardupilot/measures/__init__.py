"""ArduPilot flights and drives: how missions are found in a DataFlash log, and the extractors that read them."""

from care_core.ecosystems.ardupilot.measures import energy, events, mission, outcome, route, signals

__all__ = ["energy", "events", "mission", "outcome", "route", "signals"]

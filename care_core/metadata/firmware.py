"""What a vehicle's firmware documents of a parameter, ArduPilot's and PX4's alike."""

from __future__ import annotations

from care_core.metadata import ardupilot, px4
from care_core.metadata.fact import Fact

PX4 = "px4"
"""The kind of every vehicle that PX4 flies."""


def fact_of(name: str, kind: str, version: tuple[int, ...] | None = None) -> Fact | None:
    """What the firmware says of a parameter; the newest release that knows it where the version is unknown."""
    return px4.fact_of(name, version) if kind == PX4 else ardupilot.fact_of(name, kind, version)


def letter_of(kind: str) -> str:
    """How the tables call a kind of vehicle; empty for one that they do not know."""
    return "X" if kind == PX4 else ardupilot.VEHICLES.get(kind, "")


def is_code(fact: Fact) -> bool:
    """Whether its values have no order. ArduPilot lists presets beside a range; what PX4 lists is all there is."""
    has_range = fact.low is not None and fact.high is not None
    return bool(fact.bits) or (bool(fact.values) and (not has_range or fact.owner == px4.OWNER))

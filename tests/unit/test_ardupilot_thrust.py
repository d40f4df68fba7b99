"""Too little thrust, and an option that keeps it down."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.ecosystems.findings import every_finding
from tests.flights import DOWN_S, UP_S, Made, first


def test_too_little_thrust_and_an_option_that_keeps_it_down() -> None:
    made = Made()
    high = made.after(30.0, DOWN_S)
    made.table["CTUN"]["ThO"][high] = 0.98
    for name, field in (("CTUN", "Alt"), ("CTUN", "BAlt"), ("BARO", "Alt"), ("BARO#2", "Alt"), ("POS", "RelHomeAlt")):
        made.table[name][field][high] -= 6.0
    finding = first(made)
    assert (finding.kind, finding.severity, finding.suspect) == ("thrust", "critical", "hardware")
    made.settings["MOT_SPIN_MAX"] = 0.6
    assert first(made).suspect == "parameter"


@pytest.mark.parametrize(
    ("sinks_ms", "throttle", "is_told"), [(1.5, 0.92, True), (1.5, 0.8, False), (0.3, 0.92, False)]
)
def test_what_sinks_on_with_nearly_all_its_thrust_lacks_it(sinks_ms: float, throttle: float, is_told: bool) -> None:
    made = Made()
    made.rows["MODE"] = [(0.0, {"ModeNum": 0.0})]
    down = made.after(50.0, 54.0)
    made.table["CTUN"]["ThO"][down] = throttle
    for name, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt"), ("CTUN", "BAlt"), ("BARO", "Alt"), ("BARO#2", "Alt")):
        made.table[name][field] -= sinks_ms * np.clip(made.t - 50.0, 0.0, 4.0)
    found = [one for one in every_finding(made.find()) if one.title == "too little thrust"]
    assert [one.severity for one in found] == ["critical"] * is_told


def test_the_throttle_of_a_helicopter_is_its_collective_pitch() -> None:
    made = Made()
    made.table["CTUN"]["ThO"][made.after(UP_S, DOWN_S)] = 0.75
    assert [one.kind for one in made.find()] == ["thrust"]
    made.settings["H_COL_MIN"] = 1250  # firmware before 3.5 names no frame class
    assert made.flight().vehicle.kind == "heli"
    assert "thrust" not in [one.kind for one in made.find()]

"""What makes rate controllers late, where roll or pitch swings."""

from __future__ import annotations

import numpy as np

from care_core.ecosystems.ardupilot.checks import rate_loop
from care_core.ecosystems.findings import Finding
from tests.flights import DOWN_S, UP_S, Made


def swinging(**settings: float) -> Made:
    """A flight whose roll swings to and fro."""
    made = Made()
    made.settings |= settings
    n = len(made.t)
    made.table["RATE"] = {f"{axis}{what}": made.noise(0.5) for axis in "RP" for what in ("", "Des", "Out")}
    up = made.after(UP_S + 5, DOWN_S)
    made.table["RATE"]["R"][up] = np.where(np.arange(n) % 4 < 2, 90.0, -90.0)[up]
    made.table["PM"] |= {"LR": np.full(n, settings.get("SCHED_LOOP_RATE", 400.0))}
    return made


def told(made: Made) -> tuple[Finding, ...]:
    return tuple(rate_loop.find(made.flight()))


def test_a_main_loop_set_slow_is_named_where_the_rates_swing() -> None:
    (finding,) = told(swinging(SCHED_LOOP_RATE=50.0))
    assert finding.wanted == (("SCHED_LOOP_RATE", 400.0),)
    assert "SCHED_LOOP_RATE is 50 (default 400), and the main loop ran at 50 Hz" in finding.evidence


def test_it_leads_the_oscillation_that_it_brings_about() -> None:
    findings = swinging(SCHED_LOOP_RATE=50.0).find()
    assert findings[0].parameters == ("SCHED_LOOP_RATE",)
    assert [one.title for one in findings[0].below] == ["roll oscillates"]


def test_older_logs_count_the_loops_of_ten_seconds() -> None:
    made = swinging(SCHED_LOOP_RATE=100.0)
    del made.table["PM"]["LR"]
    made.table["PM"]["NL"][:] = 1000.0
    (finding,) = told(made)
    assert "the main loop ran at 100 Hz" in finding.evidence


def test_a_notch_among_the_frequencies_of_control_is_named() -> None:
    (finding,) = told(swinging(INS_HNTCH_ENABLE=1.0, INS_HNTCH_FREQ=10.0))
    assert finding.wanted == (("INS_HNTCH_FREQ", 80.0),)
    assert told(swinging(INS_HNTCH_ENABLE=0.0, INS_HNTCH_FREQ=10.0)) == ()
    assert told(swinging(INS_HNTCH_ENABLE=1.0, INS_HNTCH_FREQ=80.0)) == ()


def test_a_slow_loop_that_holds_its_attitude_says_nothing() -> None:
    made = swinging(SCHED_LOOP_RATE=50.0)
    made.table["RATE"]["R"] = made.noise(0.5)
    assert told(made) == ()


def test_gains_that_swing_at_the_usual_rate_are_not_the_loops_fault() -> None:
    assert told(swinging(SCHED_LOOP_RATE=300.0)) == ()

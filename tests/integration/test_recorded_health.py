"""Findings on recorded logs: silent on a good flight, the cause that an expert names first on those that failed."""

from __future__ import annotations

from pathlib import Path

import pytest

from care_core.ecosystems.ardupilot.examining import find
from care_core.ecosystems.ardupilot.flight import as_flight
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.registry import run_model
from care_core.logs.opening import open_log

GOOD = Path(__file__).parents[1] / "data" / "arducopter_good.BIN"


def findings_of(path: Path) -> tuple[Finding, ...]:
    return find(as_flight(run_model(open_log(path))))


def test_a_good_flight_is_silent() -> None:
    assert findings_of(GOOD) == ()


@pytest.mark.parametrize(
    ("name", "kind", "onset_s"),
    [
        ("dataflash_text/mechanical_fail.log", "motor", 91.3),
        ("dataflash_text/underpowered.log", "thrust", 60.0),
        ("dataflash_text/nan.log", "compass", 0.0),
        ("mavlink_tlog/copter_real_radio_23min.tlog", "battery", 465.0),
        ("mavlink_tlog/copter35_mixed_v1_v2.tlog", "crash", 60.6),
    ],
)
def test_the_cause_comes_first(recorded: Path, name: str, kind: str, onset_s: float) -> None:
    first = findings_of(recorded / "logs" / name)[0]
    assert (first.kind, first.severity) == (kind, "critical")
    assert first.onset_s == pytest.approx(onset_s, abs=5.0)


@pytest.mark.parametrize(
    "name",
    [
        "dataflash_bin/copter402_chibios_sample01.bin",
        "dataflash_bin/copter41_sitl.BIN",
        "dataflash_bin/copter46_cut_80k.bin",
        "dataflash_bin/ardusub_small.BIN",
        "mavlink_tlog/quadplane_vtol.tlog",
        "mavlink_tlog/ardusub_small.tlog",
    ],
)
def test_what_an_expert_calls_healthy_raises_no_alarm(recorded: Path, name: str) -> None:
    assert not [one for one in findings_of(recorded / "logs" / name) if one.severity == "critical"]

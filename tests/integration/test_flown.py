"""`benchmarks.flown`: the fix of a failed mission is run again on whatever a campaign's command starts."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks import flown
from care_core.collect.campaign import Campaign, read_campaign
from care_core.collect.sampling import points
from care_core.errors import ExitCode
from care_samples.arm.__main__ import main as arm
from tests.conftest import Care

pytest.importorskip("scipy")
pytest.importorskip("sklearn")


@pytest.fixture
def campaign(tmp_path: Path, care: Care, monkeypatch: pytest.MonkeyPatch) -> Campaign:
    """The lander's arm; the command line is asked in this process."""

    def asked(*words: object) -> tuple[int, str]:
        outcome = care(*map(str, words))
        return outcome.code, outcome.stdout

    monkeypatch.setattr(flown, "care", asked)
    arm(["--start", str(tmp_path / "arm")])
    return read_campaign(tmp_path / "arm" / "campaign.yaml")


def test_a_fault_is_diagnosed_repaired_run_again_and_verified(
    campaign: Campaign, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    field = flown.Field(campaign, Path("owlat"), tmp_path / "flown")
    (tmp_path / "flown").mkdir()
    asked = flown.Asked({"bundled": "owlat"}, {"first": lambda config: next(iter(config))})
    configs = points(campaign.space, "uniform", 20, 1 - flown.OFF, 3)
    found = next(
        report
        for number, config in enumerate(configs)
        if (report := flown.one_fault(field, asked, number, config, 900 + number))["fault"]
    )
    answer = found["profiles"]["bundled"]
    assert answer["code"] == ExitCode.FAULT
    assert answer["applied"] == ExitCode.OK
    assert len(answer["met"]) == 3
    # What is verified in the log is what was judged of the mission.
    assert [verdict.startswith("fixed") for verdict in answer["verdicts"]] == answer["met"]
    assert set(found["off"]) <= {axis.name for axis in campaign.space.axes}
    assert len(found["peers"]["first"]["met"]) == 2
    flown.show([{"number": 0, "fault": False}, found])
    assert "bundled: flagged 1 of 1, advised 1" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("code", "met"), [(ExitCode.OK, True), (ExitCode.FAULT, False), (ExitCode.NOT_EVALUATED, False)]
)
def test_the_simulators_own_word_counts_before_the_logs(
    campaign: Campaign, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int, met: bool
) -> None:
    monkeypatch.setattr(flown, "care", lambda *_: (code, ""))
    field = flown.Field(campaign, Path("owlat"), tmp_path)
    assert field.met(tmp_path, tmp_path / "log.bag") == met
    (tmp_path / "truth.json").write_text(json.dumps({"met": not met}), encoding="utf-8")
    assert field.met(tmp_path, tmp_path / "log.bag") != met


@pytest.mark.parametrize(("hits", "count", "low", "high"), [(0, 10, 0.0, 0.278), (5, 10, 0.237, 0.763), (0, 0, 0, 1)])
def test_intervals(hits: int, count: int, low: float, high: float) -> None:
    assert flown.wilson(hits, count) == pytest.approx((low, high), abs=0.001)

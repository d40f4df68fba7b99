"""`benchmarks.flown`: the fix of a failed mission is run again on whatever a campaign's command starts."""

from __future__ import annotations

import json
from functools import partial
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


@pytest.mark.long
def test_a_fault_is_diagnosed_repaired_run_again_and_verified(
    campaign: Campaign, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    field = flown.Field(campaign, Path("owlat"), tmp_path / "flown")
    (tmp_path / "flown").mkdir()
    done = flown.Done(tmp_path / "flown" / "faults.jsonl")
    configs = points(campaign.space, "uniform", 20, 1 - flown.OFF, 3, alike=True)
    found = next(
        report
        for number, config in enumerate(configs)
        if (report := flown.one_fault(field, {"bundled": "owlat"}, number, config, 900 + number))["fault"]
    )
    answer = found["profiles"]["bundled"]
    assert answer["code"] == ExitCode.FAULT
    assert answer["applied"] == ExitCode.OK
    assert len(answer["met"]) == 3
    # What is verified in the log is what was judged of the mission.
    assert [verdict.startswith("fixed") for verdict in answer["verdicts"]] == answer["met"]
    assert set(found["off"]) <= {axis.name for axis in campaign.space.axes}
    done.add(found)
    flown.for_each(field, done, partial(flown.compare, field, {"first": lambda _: next(iter(found["off"]))}))
    (fault,) = flown.Done(tmp_path / "flown" / "faults.jsonl").faults()
    assert len(fault["peers"]["first"]["met"]) == 2
    flown.show([{"number": -1, "fault": False}, fault])
    assert "bundled: flagged 1 of 1, advised 1" in capsys.readouterr().out


def test_options_put_back_tell_the_causes(
    campaign: Campaign, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A mission that only two options make fail, together: neither repairs it alone, both do, and all do."""
    names = [axis.name for axis in campaign.space.axes][:3]
    reference = campaign.space.reference

    def run(_field: flown.Field, _name: str, config: flown.Config, _seed: int) -> flown.Mission:
        return flown.Mission(tmp_path, all(config[name] == reference[name] for name in names[:2]))

    monkeypatch.setattr(flown.Field, "run", run)
    field = flown.Field(campaign, Path("owlat"), tmp_path)
    answer = {"code": ExitCode.FAULT, "fix": None, "causes": names[1:]}
    off = {axis.name: axis.low if axis.low != reference[axis.name] else axis.high for axis in campaign.space.axes[:3]}
    fault: flown.Report = {"number": 1, "seed": 1, "fault": True, "off": off, "profiles": {"bundled": answer}}
    fault |= flown.reset(field, fault, in_pairs=True)
    assert fault["resets"]["all"]
    assert not any(fault["resets"]["alone"].values())
    assert fault["resets"]["pairs"] == [tuple(names[:2])]
    assert flown.true_causes(fault) == set(names[:2])
    flown.show([fault])
    told = capsys.readouterr().out
    assert "the reference meets everything in 1, an option alone in 0, only pairs in 1" in told
    assert "bundled: a true cause named first 1 of 1" in told


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

"""A flight told by telemetry: the extractors give what the DataFlash log gives, or say that they cannot."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from care_core.ecosystems.examine import examine
from care_core.ecosystems.findings import LOST_SIGHT, every_finding
from care_core.ecosystems.registry import run_model
from care_core.extract.coverage import cover
from care_core.extract.read import read_run
from care_core.logs.opening import open_log
from care_core.logs.telemetry import as_dataflash
from care_core.profile.reading import read_schema
from care_core.profile.schema import Schema
from care_core.run import Run, Unavailable, is_known
from tests.groundstation import VEHICLE, write_tlog
from tests.rewritten import write_text

ROOT = Path(__file__).parents[2]
SAMPLE = ROOT / "samples" / "arducopter_failed.BIN"
TOLERANCE = {"mission_time": 1.5, "energy": 0.06, "path_error_max": 0.15, "mission_success": 0.0}
COARSER = {"waypoint_miss": 0.4, "distance": 4.0, "lean_angle_peak": 2.0, "touchdown_time": 1.0, "wind_lean": 0.5}


@pytest.fixture(scope="module")
def schema() -> Schema:
    return read_schema(ROOT / "profiles" / "arducopter" / "profile.yaml")


@pytest.fixture(scope="module")
def recorded(schema: Schema) -> Run:
    return read_run(run_model(open_log(SAMPLE)), schema)


@pytest.fixture(scope="module", params=[True, False], ids=["with_texts", "numbers_only"])
def heard(request: pytest.FixtureRequest, schema: Schema, tmp_path_factory: pytest.TempPathFactory) -> Run:
    path = write_tlog(tmp_path_factory.mktemp("tlog") / "a.tlog", SAMPLE, np.random.default_rng(3), texts=request.param)
    return read_run(run_model(open_log(path)), schema)


def test_objectives_agree_with_the_vehicles_own_log(recorded: Run, heard: Run) -> None:
    for name, tolerance in TOLERANCE.items():
        own, other = recorded.objectives[name], heard.objectives[name]
        assert is_known(own) == is_known(other), name
        if is_known(own) and is_known(other):
            assert other == pytest.approx(own, abs=tolerance), name


def test_the_configuration_is_the_same(recorded: Run, heard: Run) -> None:
    assert heard.config == recorded.config
    assert {setting.source for setting in heard.settings.values()} == {"PARAM_VALUE"}


def test_metrics_agree_or_say_where_to_find_them(recorded: Run, heard: Run) -> None:
    known = 0
    for name, own in {**recorded.metrics, **recorded.context}.items():
        other = heard.value(name)
        if not is_known(own):
            continue
        if isinstance(other, Unavailable):
            assert other.hint, name
            continue
        known += 1
        assert other == pytest.approx(own, abs=COARSER.get(name, 0.6), rel=0.03), name
    assert known >= 30
    rate = heard.metrics["roll_rate_error"]
    assert isinstance(rate, Unavailable)
    assert ".BIN" in rate.hint


def test_the_profile_finds_its_sources_in_telemetry(schema: Schema, tmp_path: Path) -> None:
    log = open_log(write_tlog(tmp_path / "a.tlog", SAMPLE, np.random.default_rng(0)))
    fit = cover(log, schema)
    assert fit.options == len(schema.options)
    assert fit.sources >= 14
    assert {"ATT", "POS", "MSG", "ATTITUDE"} <= {channel.name for channel in as_dataflash(log).channels()}
    assert as_dataflash(open_log(SAMPLE)).format.name == "dataflash-bin"


def test_a_text_log_gives_the_same_run(recorded: Run, schema: Schema, tmp_path: Path) -> None:
    run = read_run(run_model(open_log(write_text(tmp_path / "a.log", SAMPLE))), schema)
    assert run.config == {name: pytest.approx(value, rel=1e-6) for name, value in recorded.config.items()}
    for values, own in ((run.objectives, recorded.objectives), (run.metrics, recorded.metrics)):
        for name, value in own.items():
            other = values[name]
            assert other == (pytest.approx(value, rel=1e-6, abs=1e-5) if is_known(value) else value), name


def until(path: Path, last_s: float) -> Path:
    """The same telemetry, in which the vehicle is heard no more from a time on, while its station records on."""
    raw, kept, at, first = path.read_bytes(), [], 0, None
    while at < len(raw):
        stamp, magic = int.from_bytes(raw[at : at + 8], "big"), raw[at + 8]
        first = stamp if first is None else first
        size = 8 + raw[at + 9] + (12 if magic == 0xFD else 8)
        system = raw[at + 8 + (5 if magic == 0xFD else 3)]
        if system != VEHICLE[0] or stamp - first < last_s * 1e6:
            kept.append(raw[at : at + size])
        at += size
    path.write_bytes(b"".join(kept))
    return path


def test_a_vehicle_that_is_heard_no_more_in_the_air_is_told_and_its_flight_ends_there(tmp_path: Path) -> None:
    path = until(write_tlog(tmp_path / "a.tlog", SAMPLE, np.random.default_rng(0)), 90.0)
    model = run_model(open_log(path))
    health = examine(model)
    assert LOST_SIGHT in [one.title for one in every_finding(health.findings)]
    assert [one.text for one in health.timeline if one.time_s > 85.0 and "heard no more" in one.text]
    assert model.log.duration_s > 150.0
    assert max(one.end_s for one in every_finding(health.findings)) < 95.0


def test_one_that_is_heard_no_more_before_it_armed_is_told_in_the_timeline(tmp_path: Path) -> None:
    path = until(write_tlog(tmp_path / "a.tlog", SAMPLE, np.random.default_rng(0)), 12.0)
    timeline = examine(run_model(open_log(path))).timeline
    (said,) = [one.text for one in timeline if "heard no more" in one.text]
    assert said.startswith("the vehicle is heard no more; the station records for ")

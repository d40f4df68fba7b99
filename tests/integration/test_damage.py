"""Good logs of each format cut at places all along and with flipped bits: no crash, no hang, no false ok.

`CARE_DAMAGE` says how many of each; `make damage` asks for 200.

A format joins by a line in `LOGS`: how a good log of it is made, and the profile that finds it good. Every damaged log
is read, matched with the profile and judged; every tenth goes through the whole of `triage`, which must agree.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
import pytest

import care_core
from benchmarks.px4_logs import write_flight
from care_core.application.case import Request
from care_core.diagnose.judging import judge
from care_core.diagnose.verdict import verdict_of
from care_core.ecosystems.registry import run_model
from care_core.errors import CareError, ExitCode, LogError
from care_core.extract.read import read_run
from care_core.extract.select import choose_profile
from care_core.files import bundled
from care_core.logs.opening import open_log
from care_core.profile.store import Profile, load_profile
from care_core.run import MissionInfo
from tests import nav2_drive, restamped
from tests.groundstation import write_tlog
from tests.rewritten import write_ulog

pytestmark = pytest.mark.long

DATA = Path(__file__).parents[1] / "data"
SECONDS = 10.0
CUTS = FLIPS = int(os.environ.get("CARE_DAMAGE", "25"))
EVERY = 10
"""Of so many damaged logs one is diagnosed as well."""


class Good(NamedTuple):
    """A log whose mission went well: the file name that it goes by, how its bytes are made in a folder, and the
    profile; without one it is judged by the schema of the Nav2 drive."""

    name: str
    make: Callable[[Path], bytes]
    profile: str = ""


def flight(_: Path) -> bytes:
    return (DATA / "arducopter_good.BIN").read_bytes()


def flight_as_text(_: Path) -> bytes:
    """The good flight as a ground station writes it down."""
    from pymavlink import DFReader

    log = DFReader.DFReader_binary(str(DATA / "arducopter_good.BIN"))
    lines = []
    while (message := log.recv_msg()) is not None:
        values = [message.__getattr__(name) for name in message.fmt.columns]
        lines.append(", ".join([message.get_type(), *(str(value) for value in values)]))
    return ("\n".join(lines) + "\n").encode()


def flight_as_heard(folder: Path) -> bytes:
    """The good flight as telemetry."""
    rng = np.random.default_rng(0)
    return write_tlog(folder / "flight.tlog", DATA / "arducopter_good.BIN", rng).read_bytes()


def drive(_: Path) -> bytes:
    return (DATA / "move_base_good.bag").read_bytes()


def drive_as_mcap(_: Path) -> bytes:
    """The good drive as MCAP in the ros1 profile."""
    return restamped.mcap(DATA / "move_base_good.bag", lambda time_ns: time_ns)


def nav2_drive_as_db3(folder: Path) -> bytes:
    """A Nav2 drive with two goals, both reached."""
    from rosbags.rosbag2 import StoragePlugin

    nav2_drive.recorded(folder / "drive", StoragePlugin.SQLITE3)
    return next((folder / "drive").glob("*.db3")).read_bytes()


def nav2_drive_as_mcap(folder: Path) -> bytes:
    """The same in the ros2 profile: CDR, chunks packed with zstd."""
    from rosbags.rosbag2 import StoragePlugin

    nav2_drive.recorded(folder / "drive", StoragePlugin.MCAP)
    return next((folder / "drive").glob("*.mcap")).read_bytes()


LOGS = (
    Good("flight.BIN", flight, "arducopter"),
    Good("flight.log", flight_as_text, "arducopter"),
    Good("flight.tlog", flight_as_heard, "arducopter"),
    Good("drive.bag", drive, "move_base"),
    Good("drive.mcap", drive_as_mcap, "move_base"),
    Good("nav2.db3", nav2_drive_as_db3),
    Good("nav2.mcap", nav2_drive_as_mcap),
)
FAILED = Good("failed.BIN", lambda _: bundled("samples", "arducopter_failed.BIN").read_bytes(), "arducopter")
loaded = lru_cache(load_profile)


class Verdict(NamedTuple):
    """How the judgement ended: its exit code, or the code of the CareError it raised, and when the mission was."""

    code: ExitCode
    ended: bool = False
    start_s: float = 0.0
    end_s: float = 0.0


@lru_cache
def raw_of(good: Good) -> bytes:
    with TemporaryDirectory() as folder:
        return good.make(Path(folder))


@pytest.fixture(scope="module", autouse=True)
def _profiles_are_read_once() -> object:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("care_core.profile.store.load_profile", loaded)
        yield


def judged(path: Path, raw: bytes, profile: str, *, diagnosed: bool = False) -> Verdict:
    """Judge these bytes. Anything but objectives or a CareError fails the test, as does a long wait."""
    path.write_bytes(raw)
    started = time.monotonic()
    try:
        verdict = _judge(path, loaded(profile) if profile else None)
    except CareError as err:
        verdict = Verdict(err.exit_code)
    assert time.monotonic() - started < SECONDS
    if diagnosed and profile:
        found = _diagnosed(path, profile)
        # Where the profile finds no mission, what happened and the findings are the answer.
        assert found == verdict or (verdict.code, found.code) == (ExitCode.USAGE, ExitCode.NOT_EVALUATED)
        assert time.monotonic() - started < 2 * SECONDS
    return verdict


def _judge(path: Path, profile: Profile | None) -> Verdict:
    """Reading, extraction and objectives: all of triage but the explanation, which costs most and reads no byte."""
    log = open_log(path)
    if profile is not None:
        choose_profile(log, [profile])
    schema = nav2_drive.schema() if profile is None else profile.schema
    run = read_run(run_model(log), schema)
    statuses = {result.status for result in judge(run, schema, None if profile is None else profile.model).results}
    if "fault" in statuses:
        return _verdict(ExitCode.FAULT, run.mission)
    return _verdict(ExitCode.NOT_EVALUATED if "not_evaluated" in statuses else ExitCode.OK, run.mission)


def _diagnosed(path: Path, profile: str) -> Verdict:
    try:
        diagnosis = care_core.triage(Request(path, profile)).diagnosis
    except CareError as err:
        return Verdict(err.exit_code)
    return _verdict(verdict_of(diagnosis).exit_code, diagnosis.run.mission)


def _verdict(code: ExitCode, mission: MissionInfo) -> Verdict:
    return Verdict(code, mission.ended, mission.start_s, mission.end_s)


def flipped(raw: bytes, count: int, seed: int) -> list[bytes]:
    """The bytes with one bit turned, at places and bits drawn at random."""
    rng = np.random.default_rng(seed)
    made = []
    for place, bit in zip(rng.integers(0, len(raw), count), rng.integers(0, 8, count), strict=True):
        other = bytearray(raw)
        other[place] ^= 1 << bit
        made.append(bytes(other))
    return made


@pytest.mark.parametrize("good", LOGS, ids=lambda good: good.name)
def test_a_cut_log_is_never_ok_without_the_end_of_its_mission(good: Good, tmp_path: Path) -> None:
    raw, path = raw_of(good), tmp_path / good.name
    whole = judged(path, raw, good.profile, diagnosed=True)
    assert (whole.code, whole.ended) == (ExitCode.OK, True)
    sizes = np.linspace(0, len(raw) - 1, CUTS, dtype=int)
    verdicts = [judged(path, raw[:n], good.profile, diagnosed=at % EVERY == 0) for at, n in enumerate(sizes)]
    for verdict in verdicts:
        if verdict.code is ExitCode.OK:
            assert verdict.ended
            assert verdict.end_s == pytest.approx(whole.end_s, abs=0.5)
        # What was still under way is no failure. (A log may end, whole as far as it goes, on an arming refused so far.)
        if verdict.code is ExitCode.FAULT:
            assert verdict.end_s < whole.start_s
    assert verdicts[0].code is ExitCode.UNREADABLE


@pytest.mark.parametrize("good", LOGS, ids=lambda good: good.name)
def test_flipped_bits_are_survived(good: Good, tmp_path: Path) -> None:
    path = tmp_path / good.name
    for at, raw in enumerate(flipped(raw_of(good), FLIPS, 0)):
        judged(path, raw, good.profile, diagnosed=at % EVERY == 0)


def test_no_damage_makes_a_failed_mission_good(tmp_path: Path) -> None:
    raw, path = raw_of(FAILED), tmp_path / FAILED.name
    assert judged(path, raw, FAILED.profile, diagnosed=True).code is ExitCode.FAULT
    cuts = [raw[:size] for size in np.random.default_rng(1).integers(0, len(raw), 15)]
    for damaged in (*cuts, *flipped(raw, 15, 1)):
        assert judged(path, damaged, FAILED.profile).code is not ExitCode.OK


def test_a_px4_log_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    path = tmp_path / "flight.ulg"
    raw = write_ulog(path).read_bytes()
    cuts = [raw[:size] for size in np.linspace(0, len(raw) - 1, CUTS, dtype=int)]
    counts = []
    for damaged in (*cuts, *flipped(raw, FLIPS, 0)):
        path.write_bytes(damaged)
        started = time.monotonic()
        counts.append(_rows(path))
        assert time.monotonic() - started < SECONDS
    assert counts[:CUTS] == sorted(counts[:CUTS])
    assert counts[CUTS - 1] >= 100


def test_a_damaged_px4_flight_is_triaged_and_its_damage_named(tmp_path: Path) -> None:
    path = write_flight(tmp_path / "flight.ulg", 300_000)
    raw = path.read_bytes()
    begin, whole = raw.index(b"D", raw.index(b"vehicle_land_detected", raw.rindex(b"TEST_"))), _messages(path)
    for at, size in enumerate(np.linspace(begin + 1000, len(raw) - 1, CUTS, dtype=int).tolist()):
        path.write_bytes(raw[:size])
        assert _messages(path) == pytest.approx(whole * (size - begin) / (len(raw) - begin), rel=0.1, abs=20)
        last = open_log(path).damage[-1:]
        assert all(one.what.startswith("cut in a record") and one.byte is not None for one in last)
        if at % EVERY == 0:
            assert care_core.triage(Request(path)).diagnosis.run.log.damage == last
    for at, damaged in enumerate(flipped(raw[begin:], FLIPS, 0)):
        path.write_bytes(raw[:begin] + damaged)
        assert _messages(path) >= whole - 2  # a length that is wrong and fits another record costs that one too
        if at % EVERY == 0:
            care_core.triage(Request(path))


def _messages(path: Path) -> int:
    return sum(channel.count for channel in open_log(path).channels())


def _rows(path: Path) -> int:
    """How much of a PX4 log can be read, 0 where it is refused."""
    try:
        log = open_log(path)
    except LogError:
        return 0
    tables = log.read({"battery_status": ("voltage_v", "id"), "logged_messages": ("message",)})
    return sum(len(table) for table in tables.values()) + len(log.settings())

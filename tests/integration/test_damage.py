"""Good logs cut at 200 places and with 200 flipped bits, through the whole of `triage`: no crash, no hang, no false ok.

A format joins by a line in `LOGS`: how a good log of it is made, and the profile that finds it good.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from care_core.errors import CareError
from care_core.profile.store import Profile, load_profile
from care_core.resources import bundled
from care_tui.jobs import Request, diagnose_log, exit_code

DATA = Path(__file__).parents[1] / "data"
SECONDS = 10.0
CUTS = FLIPS = 200


class Good(NamedTuple):
    """A log whose mission went well, as its bytes, and the file name that it goes by."""

    name: str
    make: Callable[[], bytes]
    profile: str


def flight_as_text() -> bytes:
    """The good flight as a ground station writes it down."""
    from pymavlink import DFReader

    log = DFReader.DFReader_binary(str(DATA / "arducopter_good.BIN"))
    lines = []
    while (message := log.recv_msg()) is not None:
        values = [message.__getattr__(name) for name in message.fmt.columns]
        lines.append(", ".join([message.get_type(), *(str(value) for value in values)]))
    return ("\n".join(lines) + "\n").encode()


def drive_as_mcap() -> bytes:
    """The good drive as MCAP in the ros1 profile."""
    from io import BytesIO

    from mcap.writer import CompressionType, Writer
    from rosbags.rosbag1 import Reader

    stream = BytesIO()
    writer = Writer(stream, chunk_size=16 * 1024, compression=CompressionType.LZ4)
    writer.start(profile="ros1", library="test")
    with Reader(DATA / "move_base_good.bag") as bag:
        channels = {}
        for connection in bag.connections:
            kind = connection.msgtype.replace("/msg/", "/")
            schema = writer.register_schema(kind, "ros1msg", connection.msgdef.data.encode())
            channels[connection.id] = writer.register_channel(connection.topic, "ros1", schema)
        for connection, time_ns, raw in bag.messages():
            writer.add_message(channels[connection.id], time_ns, bytes(raw), time_ns)
    writer.finish()  # type: ignore[no-untyped-call]
    return stream.getvalue()


LOGS = (
    Good("flight.BIN", (DATA / "arducopter_good.BIN").read_bytes, "arducopter"),
    Good("flight.log", flight_as_text, "arducopter"),
    Good("drive.bag", (DATA / "move_base_good.bag").read_bytes, "move_base"),
    Good("drive.mcap", drive_as_mcap, "move_base"),
)
FAILED = Good("failed.BIN", bundled("samples", "arducopter_failed.BIN").read_bytes, "arducopter")


class Verdict(NamedTuple):
    """How a triage ended: its exit code, or the code of the CareError it raised, and whether the mission ended."""

    code: int
    ended: bool = False
    start_s: float = 0.0
    end_s: float = 0.0


@pytest.fixture(scope="module", autouse=True)
def _profiles_are_read_once() -> object:
    """Four hundred triages of a format would read the same model four hundred times."""
    known: dict[str, Profile] = {}

    def load(name: str | Path) -> Profile:
        return known.get(str(name)) or known.setdefault(str(name), load_profile(name))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("care_core.profile.store.load_profile", load)
        yield


def judged(path: Path, raw: bytes, profile: str) -> Verdict:
    """Triage these bytes. Anything but a diagnosis or a CareError fails the test, as does a long wait."""
    path.write_bytes(raw)
    started = time.monotonic()
    try:
        diagnosis = diagnose_log(Request(path, profile), lambda _step, _share: None)
    except CareError as err:
        return Verdict(int(err.exit_code))
    finally:
        assert time.monotonic() - started < SECONDS
    mission = diagnosis.run.mission
    return Verdict(int(exit_code(diagnosis)), mission.ended, mission.start_s, mission.end_s)


@pytest.mark.parametrize("good", LOGS, ids=lambda good: good.name)
def test_a_cut_log_is_never_ok_without_the_end_of_its_mission(good: Good, tmp_path: Path) -> None:
    raw, path = good.make(), tmp_path / good.name
    whole = judged(path, raw, good.profile)
    assert (whole.code, whole.ended) == (0, True)
    verdicts = [judged(path, raw[:size], good.profile) for size in np.linspace(0, len(raw) - 1, CUTS, dtype=int)]
    for verdict in verdicts:
        assert verdict.code in (0, 1, 2, 3, 4)
        if verdict.code == 0:
            assert verdict.ended
            assert verdict.end_s == pytest.approx(whole.end_s, abs=0.5)
        # What was still under way is no failure. (A log may end, whole as far as it goes, on an arming refused so far.)
        if verdict.code == 1:
            assert verdict.end_s < whole.start_s
    assert verdicts[0].code == 4


@pytest.mark.parametrize("good", LOGS, ids=lambda good: good.name)
def test_flipped_bits_are_survived(good: Good, tmp_path: Path) -> None:
    raw, path = good.make(), tmp_path / good.name
    rng = np.random.default_rng(0)
    for place, bit in zip(rng.integers(0, len(raw), FLIPS), rng.integers(0, 8, FLIPS), strict=True):
        flipped = bytearray(raw)
        flipped[place] ^= 1 << bit
        assert judged(path, bytes(flipped), good.profile).code in (0, 1, 2, 3, 4)


def test_no_damage_makes_a_failed_mission_good(tmp_path: Path) -> None:
    raw, path = FAILED.make(), tmp_path / FAILED.name
    assert judged(path, raw, FAILED.profile).code == 1
    rng = np.random.default_rng(1)
    for size in rng.integers(0, len(raw), 15):
        assert judged(path, raw[:size], FAILED.profile).code != 0
    for place, bit in zip(rng.integers(0, len(raw), 15), rng.integers(0, 8, 15), strict=True):
        flipped = bytearray(raw)
        flipped[place] ^= 1 << bit
        assert judged(path, bytes(flipped), FAILED.profile).code != 0

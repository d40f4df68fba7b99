"""Good recordings in every container, cut at many places, or with one of many bits flipped: what is there is read."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType

from care_core.errors import LogError
from care_core.logs.base import Log, Table
from care_core.logs.opening import open_log
from tests.ros_samples import WANTED, write_bag, write_db3, write_mcap
from tests.whole import WHOLE

_PLACES = 200 if WHOLE else 60
_LONGEST_S = 10.0


def _db3(path: Path) -> None:
    write_db3(path.parent / "bag").rename(path)


WRITERS: Mapping[str, Callable[[Path], None]] = {
    "ros1-bag": write_bag,
    "mcap": write_mcap,
    "mcap-zstd": lambda path: write_mcap(path, compression=CompressionType.ZSTD),
    "mcap-lz4": lambda path: write_mcap(path, compression=CompressionType.LZ4),
    "mcap-unchunked": lambda path: write_mcap(path, use_chunking=False),
    "ros2-db3": _db3,
}


@pytest.fixture(scope="module", params=WRITERS)
def raw(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("sound") / "log"
    WRITERS[request.param](path)
    return path.read_bytes()


def read_all(path: Path) -> tuple[Log, Mapping[str, Table]] | None:
    """Everything that is asked of a log, in time; None where it is refused with a sentence."""
    begun = time.monotonic()
    try:
        log = open_log(path)
        tables = log.read(WANTED)
        log.settings(), log.channels(), log.facts, log.start, log.duration_s, log.damage
    except LogError:
        return None
    assert time.monotonic() - begun < _LONGEST_S
    return log, tables


def counts(tables: Mapping[str, Table]) -> dict[str, int]:
    return {topic: len(table) for topic, table in tables.items()}


def test_the_sound_log_has_no_damage(raw: bytes, tmp_path: Path) -> None:
    (tmp_path / "log").write_bytes(raw)
    read = read_all(tmp_path / "log")
    assert read is not None
    assert read[0].damage == ()
    assert counts(read[1]) == {"/imu": 60, "/note": 60}
    assert read[1]["/note"]["data"].tolist() == [f"message {row} é" for row in range(60)]


def test_cut_anywhere(raw: bytes, tmp_path: Path) -> None:
    path = tmp_path / "log"
    kept = []
    for size in np.linspace(1, len(raw) - 1, _PLACES, dtype=int).tolist():
        path.write_bytes(raw[:size])
        read = read_all(path)
        if read is None:
            continue
        log, tables = read
        assert log.damage, f"cut at {size}"
        for topic, table in tables.items():
            assert len(table) <= 60
            rows = np.rint(table.t * 10).astype(int)
            if topic == "/note" and log.start == "2020-09-13T12:26:40+00:00":
                assert table["data"].tolist() == [f"message {row} é" for row in rows]
        kept.append((size, sum(counts(tables).values())))
    sizes, found = np.array(kept).T
    assert path.read_bytes() == raw[: sizes[-1]]
    # Nearly all that lies before the cut is read: what is missing is its share of the bytes, and a chunk or page.
    assert found.max() >= 100
    assert np.all(found[sizes > 0.8 * len(raw)] >= 60)


def test_a_bit_flipped_anywhere(raw: bytes, tmp_path: Path) -> None:
    path = tmp_path / "log"
    rng = np.random.default_rng(0)
    for bit in rng.integers(0, 8 * len(raw), _PLACES).tolist():
        broken = bytearray(raw)
        broken[bit // 8] ^= 1 << bit % 8
        path.write_bytes(broken)
        read = read_all(path)
        if read is None:
            continue
        log, tables = read
        assert sum(channel.count for channel in log.channels()) <= 120
        total = sum(counts(tables).values())
        assert total <= 120
        has_topics = {"/imu", "/note"} == set(tables)
        is_checked = raw.startswith(b"\x89MCAP") and b"lz4" not in raw and log.damage == ()
        if is_checked and has_topics and total < 120:
            pytest.fail(f"bit {bit}: {120 - total} messages lost without a word")


def test_where_and_when_a_cut_log_ends(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    write_mcap(tmp_path / "whole.mcap")
    raw = (tmp_path / "whole.mcap").read_bytes()
    bag.mkdir()
    (bag / "a_0.mcap").write_bytes(raw[: len(raw) // 2])
    (bag / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n  duration:\n    nanoseconds: 599900000001\n  relative_file_paths: [a_0.mcap]\n"
    )
    (cut,) = open_log(bag).damage
    assert cut.byte is not None
    assert cut.what.startswith("read to ")
    assert f" of about 600 s (10:00), cut at byte {cut.byte}: " in cut.what
    assert cut.time_s == pytest.approx(open_log(bag).duration_s)
    assert 0 < open_log(bag).duration_s < 5.9


@pytest.mark.parametrize("write", [write_bag, write_mcap], ids=["ros1-bag", "mcap"])
def test_a_log_that_is_cut_inside_a_chunk_is_cut_where_its_bytes_end(
    write: Callable[[Path], None], tmp_path: Path
) -> None:
    log = tmp_path / "log"
    write(log)
    raw = log.read_bytes()
    log.write_bytes(raw[: len(raw) // 2])
    read = read_all(log)
    assert read is not None
    (cut,) = read[0].damage
    assert cut.byte == len(raw) // 2
    assert cut.time_s == pytest.approx(max(table.t[-1] for table in read[1].values() if len(table)))


def test_a_cut_chunk_says_how_far_the_log_went_at_least(tmp_path: Path) -> None:
    log = tmp_path / "log"
    write_mcap(log, chunk_size=1 << 20)
    raw = log.read_bytes()
    log.write_bytes(raw[: len(raw) // 3])
    (cut,) = open_log(log).damage
    assert " of at least 5.9 s, cut at byte " in cut.what or " of at least 6 s, cut at byte " in cut.what

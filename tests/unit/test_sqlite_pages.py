"""The rows that SQLite wrote are found in its pages."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np

from care_core.logs.file_windows import opened
from care_core.logs.sqlite_pages import MAGIC, Pages, StoredRow

_WIDTHS = (0, 1, 2, 127, 128, 32_767, 32_768, 2**23, 2**31, 2**47, 2**63 - 1)
INTEGERS = [*_WIDTHS, *(-number - 1 for number in _WIDTHS)]
"""The smallest and largest of each width that SQLite stores."""


def _rows(path: Path) -> tuple[list[list[int]], list[StoredRow]]:
    """Row id, integers and byte of the plain rows, and the others, as a walk over the pages finds them."""
    plain: list[list[int]] = []
    others: list[StoredRow] = []
    with opened(path, MAGIC, "SQLite") as log:
        pages = Pages(log)
        for table, rest in pages.rows():
            plain += table.tolist()
            others += rest
        for number, first, second, place in plain:
            row = pages.row(place)
            assert [row.id, *row.numbers()] == [number, None, first, second]
    return plain, others


def test_integers_of_every_width_and_blobs_of_every_length_are_found(tmp_path: Path) -> None:
    path = tmp_path / "log.db3"
    rows = [
        (ordinal + 2**ordinal, first, second, bytes(ordinal * 41))
        for ordinal, (first, second) in enumerate(zip(INTEGERS, reversed(INTEGERS), strict=True))
    ]
    with closing(sqlite3.connect(path)) as database:
        database.execute("CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id, timestamp, data BLOB)")
        database.execute("CREATE TABLE topics (id INTEGER PRIMARY KEY, name TEXT, type TEXT)")
        database.executemany("INSERT INTO messages VALUES (?, ?, ?, ?)", rows)
        database.executemany("INSERT INTO messages VALUES (?, 1, 2, x'00')", [(-5,), (2**40,), (2**62,)])
        database.execute("INSERT INTO topics VALUES (1, '/odom', 'nav_msgs/msg/Odometry')")
        database.commit()
        expected = sorted(row[:3] for row in database.execute("SELECT id, topic_id, timestamp FROM messages"))
    plain, others = _rows(path)
    found: list[tuple[int | None, ...]] = [(number, first, second) for number, first, second, _ in plain]
    found += [(row.id, *row.numbers()[1:]) for row in others if row.types[-1] % 2 == 0]
    assert sorted(found) == expected
    assert len(plain) > len(rows) // 2
    assert [row.local[row.head :] for row in others if row.id == 1 and len(row.types) == 3] == [
        b"/odomnav_msgs/msg/Odometry"
    ]


def test_in_random_pages_a_walk_finds_what_a_look_at_each_row_does(tmp_path: Path) -> None:
    path = tmp_path / "log.db3"
    rng = np.random.default_rng(0)
    pages = rng.integers(0, 256, (64, 4096), dtype=np.uint8)
    pages[:, 0] = 0x0D
    path.write_bytes(MAGIC + pages.tobytes()[len(MAGIC) :])
    plain, _ = _rows(path)
    assert all(0 <= place < 64 * 4096 for *_, place in plain)

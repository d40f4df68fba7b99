"""What a file may claim: bounds on sizes, depths and counts, each far above what any honest file holds.

A file below 10 MB is read in 1 GB of memory and 20 s whatever it says of itself. Readers that meet more say so as
damage or as an error, with the number; nothing is allocated, unpacked or followed before its size was asked here.
"""

from __future__ import annotations

MEBIBYTE = 1 << 20

HELD_BYTES = 4 * MEBIBYTE
"""Of a log held in memory as a whole. A larger one is read where it is asked for, again each time, from the system's
cache of files: 60 ms a gigabyte."""
VALUES_BYTES, LEAST_VALUES_BYTES, VALUES_SHARE = 20 * MEBIBYTE, MEBIBYTE, 4
"""Of fields of a DataFlash log that are held as they are stored, beside what a check makes of them, and of the times of
its records: one byte of four of the log each, within these bounds."""
UNPACKED_BYTES, UNPACKED_RATIO = 256 * MEBIBYTE, 32
"""Laser scans pack 5:1, costmaps 30:1 and more, but no log is mostly empty costmaps."""
WHOLE_BYTES = 256 * MEBIBYTE
"""A log up to this size is digested as a whole, and a chunk that is opened is unpacked and checked to its end. Of a
larger one only what is asked for is read: hours of cameras and point clouds that nobody looks at."""
CHUNK_BYTES = 128 * MEBIBYTE
"""Recorders write chunks of 1 to 10 MB; the largest single messages are point clouds of some 50 MB."""

MESSAGES, BYTES_A_MESSAGE = 1_000_000, 8
"""A message takes far more bytes, packed or not."""
ELEMENTS = 100_000
"""Of a list of messages inside a message: diagnostics and goal lists hold hundreds."""
FIELDS = 5_000
"""Of a message, its parts' included: the largest of the ROS distributions has below 1000."""
DEFINITION_BYTES = MEBIBYTE
TOPIC_DEFINITIONS = 500
"""Different ones that are compiled for one reading; a robot publishes some 100 types."""

EVENT_TEXTS_BYTES = 8 << 20
"""Of the texts of a log's events, unpacked; those of PX4 v1.16 take 0.2 MB."""
ULOG_TOPICS = 4_096
"""Subscriptions of a ULog; a vehicle logs some 200."""
TEXT_MESSAGE_TYPES = 1_000
"""A DataFlash log numbers its types by one byte."""

SMALL_FILE_BYTES = 16_000_000
"""Of any file that is read whole and is no log, table or model: configurations, reports, campaigns, profiles."""
TABLE_BYTES = 512 * MEBIBYTE
"""Of a table of runs: 100,000 runs of 500 variables."""
YAML_BYTES = 16 * MEBIBYTE
YAML_DEPTH = 64
YAML_NODES = 200_000
"""With every alias counted as what it stands for."""
INTEGER_DIGITS = 300
"""No more fit into a float."""

MODEL_BYTES = 64 * MEBIBYTE
"""Of a profile's arrays; the bundled ones stay below 3 MB."""


def values_bytes(size: int) -> int:
    """The most bytes of fields, and of times, that are held of a DataFlash log of `size` bytes."""
    return min(max(size // VALUES_SHARE, LEAST_VALUES_BYTES), VALUES_BYTES)


def unpacked_bytes(packed: int) -> int:
    """The most bytes that a file or stream of `packed` bytes may unpack to, all its chunks together."""
    return UNPACKED_BYTES + UNPACKED_RATIO * packed


def messages(size: int) -> int:
    """The most messages, or elements of lists in messages, that a log of `size` bytes may hold."""
    return MESSAGES + size // BYTES_A_MESSAGE


def megabytes(size: int) -> str:
    """A size as errors tell it."""
    return f"{size / 1e6:.0f} MB"

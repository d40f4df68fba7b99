from __future__ import annotations

import gc
import weakref

from care_core.records import Record, read


class Entry(Record):
    value: float | None


class Log:
    """Something large that a caller holds."""


def test_what_a_caller_held_goes_with_it_without_a_search_for_cycles() -> None:
    """A worker triages thousands of logs, and each would keep its arrays until the next full collection."""

    def read_beside_a_log() -> weakref.ref[Log]:
        log = Log()
        assert read(Entry, {"value": None}) == Entry(None)
        return weakref.ref(log)

    was_on = gc.isenabled()
    gc.disable()
    try:
        assert read_beside_a_log()() is None
    finally:
        if was_on:
            gc.enable()

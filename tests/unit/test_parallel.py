"""Work in other processes: one that dies, hangs or fails is told, and the rest is done."""

from __future__ import annotations

import os
import signal
import time

import pytest

from care_core.errors import LogError
from care_core.parallel import Failed, each

LIMIT_S = 3.0


def work(item: str) -> str:
    if item == "exit":
        os._exit(7)
    if item == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
    if item == "hang":
        time.sleep(60)
    if item == "memory":
        raise MemoryError
    if item == "refused":
        raise LogError("It is empty.", hint="Record again.")
    if item == "defect":
        raise ValueError("zero")
    return item.upper()


@pytest.mark.long
def test_one_bad_item_never_stops_the_rest() -> None:
    items = ["a", "exit", "b", "hang", "kill", "memory", "refused", "defect", "c"]
    answers = {items[place]: answer for place, answer in each(work, items, workers=2, limit_s=LIMIT_S)}
    assert [answers[item] for item in "abc"] == ["A", "B", "C"]
    reasons = {item: answer.reason for item, answer in answers.items() if isinstance(answer, Failed)}
    assert reasons == {
        "exit": "reading it ended the process (exit code 7)",
        "hang": "reading it took longer than 3 s",
        "kill": "reading it ended the process (SIGKILL, is the memory full?)",
        "memory": "the memory was not enough to read it",
        "refused": "It is empty. Record again.",
        "defect": "unexpected ValueError: zero",
    }
    assert [item for item, a in answers.items() if isinstance(a, Failed) and a.is_final] == ["refused"]


def test_nothing_to_do() -> None:
    assert list(each(work, [])) == []


@pytest.mark.parametrize("workers", [1, 4])
def test_every_item_is_answered_once(workers: int) -> None:
    items = [f"item {n}" for n in range(20)]
    assert sorted(each(work, items, workers=workers)) == [(n, f"ITEM {n}") for n in range(20)]

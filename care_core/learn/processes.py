"""Work that several processes share, one thread each: the matrices are too small to share between threads."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, contextmanager
from contextvars import ContextVar
from typing import TypeVar

from threadpoolctl import threadpool_limits

from care_core.errors import LearningError
from care_core.parallel import Failed, Worker, each

Answer = TypeVar("Answer")

_spare: ContextVar[list[Worker] | None] = ContextVar("processes that wait for the next call", default=None)


@contextmanager
def kept_processes() -> Iterator[None]:
    """While this is open, the processes of one call of `answers` are there for the next: each takes 2 s to import what
    learning needs."""
    workers: list[Worker] = []
    token = _spare.set(workers)
    try:
        yield
    finally:
        _spare.reset(token)
        for worker in workers:
            worker.end()


def answers(calls: Iterable[Callable[[], Answer]], n_jobs: int) -> list[Answer]:
    """What each call answers, in their order.

    A call takes its seed or what was drawn for it along, so the answers do not depend on the number of processes. The
    longest ones come first, or one process has nothing to do at the end.

    Args:
        calls: made of what can be imported by name, where several processes share them.
        n_jobs: processes; 1 is this one.

    Raises:
        LearningError: a call failed in another process, or ended it.
    """
    asked = list(calls)
    if n_jobs == 1 or len(asked) < 2:
        return [_alone(call) for call in asked]
    found: dict[int, Answer] = {}
    with closing(each(_alone, asked, workers=n_jobs, limit_s=math.inf, spare=_spare.get())) as done:
        for place, answer in done:
            if isinstance(answer, Failed):
                raise LearningError(f"A part of the learning failed: {answer.reason.removeprefix('reading ')}")
            found[place] = answer
    return [found[place] for place in range(len(asked))]


def _alone(call: Callable[[], Answer]) -> Answer:
    with threadpool_limits(1):  # the last digits depend on the number of threads
        return call()

"""Work that several processes share, one thread each: the matrices are too small to share between threads."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

from joblib import Parallel, delayed, parallel_config
from threadpoolctl import threadpool_limits

Answer = TypeVar("Answer")


def answers(calls: Iterable[Callable[[], Answer]], n_jobs: int) -> list[Answer]:
    """What each call answers, in their order.

    A call takes its seed or what was drawn for it along, so the answers do not depend on the number of processes. The
    longest ones come first, or one process has nothing to do at the end.
    """
    with parallel_config("loky", n_jobs=n_jobs, inner_max_num_threads=1):
        found: list[Answer] = Parallel()(delayed(_alone)(call) for call in calls)
    return found


def _alone(call: Callable[[], Answer]) -> Answer:
    with threadpool_limits(1):  # the last digits depend on the number of threads
        return call()

"""Threads that nobody waits for long: not the operator who stops their work, nor the end of the program.

asyncio's own pool is waited for when the program ends, and reading a large log would hold the terminal until then. A
moment they get: one that comes back from native code while Python is being torn down aborts the process.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")
_MOST_S = 1.0
"""That is waited for work that was told to stop; the terminal was given back before."""


class DaemonThreads(ThreadPoolExecutor):
    """A thread for each piece of work; `asyncio` takes no executor that is not of this class."""

    def __init__(self) -> None:
        super().__init__()
        self._working: set[threading.Thread] = set()

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        future: Future[T] = Future()

        def run() -> None:
            if future.set_running_or_notify_cancel():
                try:
                    answer = fn(*args, **kwargs)
                except BaseException as err:  # as the pool does: whoever waits for the future is told
                    future.set_exception(err)
                else:
                    future.set_result(answer)
            self._working.discard(thread)

        thread = threading.Thread(target=run, daemon=True)
        self._working.add(thread)
        thread.start()
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """The threads go with the program, those that end in a moment before it."""
        until_s = time.monotonic() + _MOST_S
        for thread in tuple(self._working):
            thread.join(max(until_s - time.monotonic(), 0.0))

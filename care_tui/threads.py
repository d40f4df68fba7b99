"""Threads that nobody waits for: not the operator who stops their work, nor the end of the program.

asyncio's own pool is waited for when the program ends, and reading a large log would hold the terminal until then.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


class DaemonThreads(ThreadPoolExecutor):
    """A thread for each piece of work; `asyncio` takes no executor that is not of this class."""

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        future: Future[T] = Future()

        def run() -> None:
            if not future.set_running_or_notify_cancel():
                return
            try:
                answer = fn(*args, **kwargs)
            except BaseException as err:  # as the pool does: whoever waits for the future is told
                future.set_exception(err)
            else:
                future.set_result(answer)

        threading.Thread(target=run, daemon=True).start()
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """The threads go with the program."""

"""The same work on many items in other processes: one that crashes or hangs is told and never stops the rest.

A pool of the standard library is broken for everybody when one of its processes dies, and waits for ever for one that
hangs. Here each process talks to the parent over its own pipe and is replaced when it is lost.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, Generic, TypeVar

from care_core.errors import CareError
from care_core.records import Record, Struct
from care_core.starting import isolated_children

Item = TypeVar("Item")
Answer = TypeVar("Answer")

_LOOK_S = 0.2
"""How often the time limit is looked at."""


class Failed(Record):
    """No answer for an item, and why. `is_final`: the item itself is at fault, so trying again is of no use."""

    reason: str
    is_final: bool


class Worker(Struct, eq=False):
    """A process, the parent's end of its pipe, and the item that it works on since `since` (monotonic seconds)."""

    process: BaseProcess
    pipe: Connection
    function: Callable[[Any], Any] | None = None
    item: int | None = None
    since: float = 0.0

    def give(self, function: Callable[[Any], Any], place: int, item: object) -> None:
        """Have it answer an item; the function is sent where it is another than before."""
        is_known = self.function is function
        self.function, self.item, self.since = function, place, time.monotonic()
        with suppress(OSError):  # it died meanwhile, which its sentinel tells
            self.pipe.send((None if is_known else function, item))

    def end(self) -> None:
        """Kill it, whatever it does."""
        self.process.kill()
        self.process.join()
        self.pipe.close()


class _Pool(Generic[Item, Answer]):
    """The processes and what is still to be given to them."""

    def __init__(
        self, function: Callable[[Item], Answer], items: Sequence[Item], limit_s: float, spare: list[Worker] | None
    ) -> None:
        self._function, self._items, self._limit_s, self._spare = function, items, limit_s, spare
        self._next = 0
        self._workers: list[Worker] = []
        # A fresh interpreter holds no lock of the parent's threads and none of its pipes.
        self._context = multiprocessing.get_context("spawn")

    def start(self) -> None:
        """One more process, with an item if there is one left."""
        if self._next < len(self._items):
            worker = self._spare.pop() if self._spare else self._spawned()
            self._workers.append(worker)
            self._feed(worker)

    def answers(self) -> Iterator[tuple[int, Answer | Failed]]:
        while self._workers:
            ready = wait([worker.pipe for worker in self._workers], timeout=_LOOK_S)
            for worker in list(self._workers):
                if worker.pipe in ready:
                    yield self._answer(worker)
                elif time.monotonic() - worker.since > self._limit_s:
                    yield self._lose(worker, f"reading it took longer than {self._limit_s:g} s")

    def close(self) -> None:
        for worker in self._workers:
            worker.end()

    def _spawned(self) -> Worker:
        ours, theirs = self._context.Pipe()
        process = self._context.Process(target=_serve, args=(theirs,), daemon=True)
        with isolated_children():
            process.start()
        theirs.close()
        return Worker(process, ours)

    def _answer(self, worker: Worker) -> tuple[int, Answer | Failed]:
        place = self._place(worker)
        try:
            answer: Answer | Failed = worker.pipe.recv()
        except (EOFError, OSError):
            worker.process.join()
            return self._lose(worker, f"reading it ended the process ({_ending(worker.process.exitcode)})")
        self._feed(worker)
        return place, answer

    def _feed(self, worker: Worker) -> None:
        if self._next < len(self._items):
            worker.give(self._function, self._next, self._items[self._next])
            self._next += 1
            return
        self._workers.remove(worker)
        if self._spare is None:
            worker.end()
        else:
            self._spare.append(worker)

    def _lose(self, worker: Worker, reason: str) -> tuple[int, Failed]:
        place = self._place(worker)
        self._workers.remove(worker)
        worker.end()
        self.start()
        return place, Failed(reason, is_final=False)

    @staticmethod
    def _place(worker: Worker) -> int:
        if worker.item is None:
            raise ValueError("a worker without an item has no answer")
        return worker.item


def each(
    function: Callable[[Item], Answer],
    items: Sequence[Item],
    *,
    workers: int | None = None,
    limit_s: float = 600.0,
    spare: list[Worker] | None = None,
) -> Generator[tuple[int, Answer | Failed], None, None]:
    """`function(item)` of every item, as (place of the item, answer), in the order in which they are done.

    Args:
        function: importable by name, as its arguments and answers must be sent between processes.
        workers: processes; one a core when None.
        limit_s: seconds after which an item's process is ended.
        spare: processes that wait for work: they are taken first, and those that have no more are put there.
    """
    pool: _Pool[Item, Answer] = _Pool(function, items, limit_s, spare)
    try:
        for _ in range(min(workers or os.cpu_count() or 1, len(items))):
            pool.start()
        yield from pool.answers()
    finally:
        pool.close()


def _serve(pipe: Connection) -> None:
    """Body of a process: answer items until the parent hangs up."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl+C is the parent's to handle
    function: Any = None
    with suppress(EOFError, OSError):
        while True:
            new, item = pipe.recv()
            function = new or function
            pipe.send(_attempt(function, item))


def _attempt(function: Callable[[Item], Answer], item: Item) -> Answer | Failed:
    try:
        return function(item)
    except CareError as err:
        return Failed(f"{err.message} {err.hint}".strip(), is_final=True)
    except MemoryError:
        return Failed("the memory was not enough to read it", is_final=False)
    except Exception as err:  # a defect met in one item must not lose the others
        return Failed(f"unexpected {type(err).__name__}: {err}", is_final=False)


def _ending(code: int | None) -> str:
    if code is None or code >= 0:
        return f"exit code {code}"
    name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
    return f"{name}, is the memory full?" if name == "SIGKILL" else name

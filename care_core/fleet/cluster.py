"""The same work on many items by Dask: on processes of this machine, or on a cluster that is named.

No more items are handed out than there are threads to work on them: a million logs wait here, in a list of names, not
in the memory of a scheduler, and an item whose worker dies was the only one there. Those are tried again alone, when
all others are done: one that ends its worker again and again is told, and stops nothing.

Processes of this machine talk over the loopback with a certificate made for this run: nobody else's process may send
them work, and nothing listens for browsers.
"""

from __future__ import annotations

import gc
import logging
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import Any, TypeVar

from care_core.errors import UsageError
from care_core.extras import install_hint
from care_core.parallel import Failed
from care_core.starting import isolated_children

Item = TypeVar("Item")
Answer = TypeVar("Answer")

TRIES = 2
"""How often an item whose worker died is tried again, alone."""
_LOOK_S = 0.5
"""How often time limits are looked at, and how many threads there are."""
_CONNECT_S = 10.0
_GONE_S = 300.0
"""A cluster that has no worker for so long has none any more: a lost process is replaced within seconds."""


@contextmanager
def connected(scheduler: str | None = None, *, workers: int = 1, memory: str | None = None) -> Iterator[Any]:
    """A Dask client: of the scheduler at this address, else of as many processes here.

    Args:
        scheduler: `tcp://HOST:PORT` or `tls://HOST:PORT`.
        workers: processes of a local cluster.
        memory: of each of them, such as `2GB`; an equal share of the machine's when None.

    Raises:
        UsageError: Dask is not installed, the scheduler does not answer, or its workers have another `care`.
    """
    try:
        import distributed

        import_module("cryptography")  # for the certificate of a local cluster
    except ModuleNotFoundError as err:
        raise UsageError(
            f"A fleet needs {err.name}, which is not installed.",
            hint=f"{install_hint('fleet')}; 'care triage LOG...' tells each in a line without it.",
        ) from err
    if scheduler is None:
        _check_memory(memory)
        with _local(workers, memory) as client:
            yield client
        return
    try:
        client = patiently(lambda: distributed.Client(scheduler, timeout=_CONNECT_S))
    except (OSError, ValueError, TypeError) as err:
        raise UsageError(
            "No scheduler answers there.", hint="Start one with 'dask scheduler'.", where=scheduler
        ) from err
    with client:
        _check_workers(client, scheduler)
        yield client


def patiently(start: Callable[[], Answer]) -> Answer:
    """Start something of Dask's, which gives the thread of its loop ten seconds to begin and else fails an assertion:
    on a machine that is busy enough for that it is started again.

    What failed to start closes itself when it is collected. Where that happens while another starts, Dask waits for
    itself for ever: so it is collected before.
    """
    for _ in range(TRIES):
        gc.collect()
        with suppress(AssertionError):
            return start()
    gc.collect()
    return start()


def _check_memory(size: str | None) -> None:
    from dask.utils import parse_bytes

    try:
        if size is None or parse_bytes(size) > 0:
            return
    except ValueError:
        pass
    raise UsageError(f"'{size}' is no size.", hint="Write it as 2GB or 500MB.", where="--memory")


@contextmanager
def _local(workers: int, memory: str | None) -> Iterator[Any]:
    import dask
    import distributed

    with tempfile.TemporaryDirectory(prefix="care-fleet-") as scratch:
        ours = {
            "n_workers": workers,
            "threads_per_worker": 1,
            "processes": True,
            "host": "127.0.0.1",
            "dashboard_address": "127.0.0.1:0",
            "worker_dashboard_address": "127.0.0.1:0",
            "memory_limit": memory or "auto",
            "security": distributed.Security.temporary(),
            "silence_logs": logging.CRITICAL,
            "local_directory": scratch,
        }
        settings = {
            "distributed.scheduler.allowed-failures": 0,
            # On a busy machine a process takes long to begin; by default it would be given up meanwhile.
            "distributed.deploy.lost-worker-timeout": f"{_GONE_S:g}s",
            "distributed.comm.timeouts.connect": f"{_GONE_S:g}s",
            # Dask samples where its workers are a hundred times a second and keeps an hour of it in their memory.
            "distributed.worker.profile.enabled": False,
            # What is served over HTTP asks for no certificate.
            "distributed.scheduler.http.routes": [],
            "distributed.worker.http.routes": [],
            "distributed.worker.multiprocessing-method": "forkserver",
        }
        with (
            dask.config.set(settings),
            isolated_children(),
            _ignoring_interrupts(),
            patiently(lambda: distributed.LocalCluster(**ours)) as cluster,
            distributed.Client(cluster) as client,
        ):
            yield client


@contextmanager
def _ignoring_interrupts() -> Iterator[None]:
    """Have the server that our processes are forked from, and with it all of them, not hear Ctrl+C: it is this
    process's to handle, which ends them."""
    from multiprocessing import forkserver
    from threading import current_thread, main_thread

    from distributed.utils import get_mp_context

    get_mp_context()  # what the server imports beforehand
    if current_thread() is main_thread():
        before = signal.signal(signal.SIGINT, signal.SIG_IGN)
        try:
            forkserver.ensure_running()
        finally:
            signal.signal(signal.SIGINT, before)
    yield


def _check_workers(client: Any, scheduler: str) -> None:
    """Workers without this program, or with another version of it, would give other answers or none."""
    from distributed import TimeoutError as NoWorkers

    try:
        client.wait_for_workers(1, timeout=_CONNECT_S)
        versions = set(client.run(_version).values())
    except NoWorkers as err:
        raise UsageError("The scheduler has no workers.", hint="Start some: 'dask worker'.", where=scheduler) from err
    except ModuleNotFoundError as err:
        raise UsageError("Its workers have no 'care'.", hint="Install it there as here.", where=scheduler) from err
    if versions != {_version()}:
        found = ", ".join(sorted(f"care {care} on Python {python}" for care, python in versions))
        raise UsageError(f"Its workers have {found}.", hint="Install there what is here.", where=scheduler)


def _version() -> tuple[str, str]:
    """The version of this program, and of Python."""
    try:
        care = version("care-tui")
    except PackageNotFoundError:  # run from its source
        care = ""
    return care, f"{sys.version_info.major}.{sys.version_info.minor}"


def each(
    client: Any, function: Callable[[Item], Answer], items: Sequence[Item], *, limit_s: float
) -> Generator[tuple[int, Answer | Failed], None, None]:
    """`function(item)` of every item, as (place of the item, answer), in the order in which they are done.

    Args:
        function: importable by name on the workers; pure.
        limit_s: seconds that an item may take.

    Raises:
        UsageError: the scheduler or all its workers went away.
    """
    lost: list[int] = []
    for place, answer in _answers(client, function, items, range(len(items)), limit_s, None):
        if answer is None:
            lost.append(place)
        else:
            yield place, answer
    for place in lost:
        yield place, _alone(client, function, items, place, limit_s)


def _alone(
    client: Any, function: Callable[[Item], Answer], items: Sequence[Item], place: int, limit_s: float
) -> Answer | Failed:
    """An item whose worker died, once more with nothing beside it."""
    for _ in range(TRIES):
        for _, answer in _answers(client, function, items, [place], limit_s, 1):
            if answer is not None:
                return answer
    return Failed(f"it ended the process that read it {1 + TRIES} times: too little memory, or a defect", is_final=True)


def _answers(
    client: Any,
    function: Callable[[Item], Answer],
    items: Sequence[Item],
    places: Sequence[int],
    limit_s: float,
    width: int | None,
) -> Iterator[tuple[int, Answer | Failed | None]]:
    """The answers; None of an item whose worker died. `width` items at once, one a thread when None."""
    from distributed import TimeoutError as NoneYet
    from distributed import wait

    threads = _Threads(client)
    left = iter(places)
    pending: dict[Any, tuple[int, float]] = {}
    try:
        while True:
            while len(pending) < (width or threads.count()) and (place := next(left, None)) is not None:
                pending[client.submit(function, items[place], pure=False)] = place, time.monotonic()
            if not pending:
                return
            threads.count()
            try:
                done = wait(list(pending), timeout=_LOOK_S, return_when="FIRST_COMPLETED").done
            except NoneYet:
                done = set()
            for future in done:
                place, _ = pending.pop(future)
                yield place, _answer(future)
                future.release()
            for future in [one for one, (_, since) in pending.items() if time.monotonic() - since > limit_s]:
                place, _ = pending.pop(future)
                _abandon(client, future)
                yield place, Failed(f"reading it took longer than {limit_s:g} s", is_final=False)
    finally:
        if pending:
            client.cancel(list(pending), force=True)


def _answer(future: Any) -> Any:
    """What became of an item: its answer, why there is none, or None where its worker died."""
    from concurrent.futures import CancelledError

    from distributed.scheduler import KilledWorker

    try:
        return future.result()
    except KilledWorker:
        return None
    except CancelledError as err:
        raise UsageError("The scheduler went away.", hint="Start it again.") from err
    except MemoryError:
        return Failed("the memory was not enough to read it", is_final=False)
    except Exception as err:  # a defect met in one item must not lose the others
        return Failed(f"unexpected {type(err).__name__}: {err}", is_final=False)


def _abandon(client: Any, future: Any) -> None:
    """Give up an item that takes too long. A process of ours is replaced; another's goes on until it is done."""
    workers = [address for address, keys in client.processing().items() if future.key in keys]
    client.cancel([future], force=True)
    if client.cluster is not None and workers:
        client.restart_workers(workers, raise_for_error=False)


class _Threads:
    """How many threads there are to work, looked up now and then: processes die and join."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._count, self._asked, self._seen = 0, -_LOOK_S, time.monotonic()

    def count(self) -> int:
        """At least 1, so that an item waits at the scheduler for the process that is being replaced.

        Raises:
            UsageError: there has been none for too long.
        """
        now = time.monotonic()
        if now - self._asked >= _LOOK_S:
            self._count, self._asked = sum(self._client.nthreads().values()), now
        if self._count:
            self._seen = now
        elif now - self._seen > _GONE_S:
            raise UsageError("No worker is left.", hint="Give them more memory, or start new ones.")
        return max(1, self._count)

"""`care fleet`: every log is triaged on a worker, and the rows that come back are looked at together."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from contextlib import closing
from functools import partial
from typing import TYPE_CHECKING

from care_core.application.case import Case, Request, open_case
from care_core.errors import CareError
from care_core.fleet.fleet_report import Fleet, together
from care_core.fleet.rows import Row, by_folder, row_of, unreadable
from care_core.fleet.sources import Source, fetched, gather
from care_core.progress import Progress, silent
from care_core.records import Record, replace

if TYPE_CHECKING:
    from care_core.causal.counterfactual import CounterfactualQuery

_PACE_LOGS = 5
"""So many logs say how long the rest will take."""


class Cluster(Record):
    """Where the work is done, and how much of it one log may take."""

    scheduler: str | None = None
    """Address of a Dask scheduler; processes of this machine when None."""
    workers: int | None = None
    """Processes of this machine; one a core when None, and never more than logs."""
    memory: str | None = None
    """Of each process; an equal share of the machine's when None."""
    limit_s: float = 600.0


def survey(
    places: Sequence[str], asked: Request, cluster: Cluster, progress: Progress, *, folders: bool = False
) -> Fleet:
    """Triage every log at these places and look at what came of it.

    Args:
        places: files, folders, patterns and URLs.
        asked: how every log is looked at; its own log is not used.
        folders: the folder of a log is its robot's name, where the log names none.

    Raises:
        CareError: there is no log, no cluster to work on, or a file is named that is not there.
    """
    _check(asked)
    sources = gather(places)
    rows = triage_all(sources, asked, cluster, progress)
    progress("looking at what they share", 1.0)
    return together([by_folder(row) for row in rows] if folders else rows)


def _check(asked: Request) -> None:
    """Say once what every log would say."""
    from care_core.configs.loading import read_configs
    from care_core.profile.site import load_site
    from care_core.profile.store import load_profile

    if asked.profile is not None:
        load_profile(asked.profile)
    read_configs(asked.configs)
    load_site(asked.site)


def triage_all(sources: Sequence[Source], asked: Request, cluster: Cluster, progress: Progress) -> tuple[Row, ...]:
    """A row of every log, in their order. Raises UsageError."""
    from care_core.fleet.cluster import connected, each
    from care_core.parallel import Failed

    workers = min(cluster.workers or os.cpu_count() or 1, len(sources))
    rows: dict[int, Row] = {}
    unread = 0
    progress("starting workers", 0.0)
    with connected(cluster.scheduler, workers=workers, memory=cluster.memory) as client:
        began = time.monotonic()
        work = partial(triage_one, asked=asked)
        with closing(each(client, work, sources, limit_s=cluster.limit_s)) as answers:
            for place, answer in answers:
                source = sources[place]
                row = unreadable(source.name, answer.reason) if isinstance(answer, Failed) else answer
                rows[place] = row
                unread += row.status == "unreadable"
                progress(
                    _progress_line(len(rows), unread, len(sources), time.monotonic() - began), len(rows) / len(sources)
                )
    return tuple(rows[place] for place in range(len(sources)))


def triage_one(source: Source, asked: Request) -> Row:
    """The row of one log: nothing but its bytes and the request decide it. A log that cannot be read is a row too."""
    try:
        with fetched(source) as path:
            case = open_case(replace(asked, log=path), silent)
            return replace(row_of(source.name, case.diagnosis, _world(case)), folder=source.folder)
    except CareError as err:
        return replace(unreadable(source.name, f"{err.message} {err.hint}".strip()), folder=source.folder)


def _world(case: Case) -> CounterfactualQuery | None:
    """The run as the model of its profile is asked about it, None where no mission was judged by one."""
    from care_core.diagnose.judging import query_of

    reading = case.reading
    if reading is None or reading.judged.run.checks:
        return None
    return query_of(reading.judged, reading.profile)


def _progress_line(done: int, unread: int, count: int, took_s: float) -> str:
    rate = done / max(took_s, 1e-3)
    told = f"triaged {done} of {count} logs, {unread} unreadable, {rate:.2g} a second"
    if done < _PACE_LOGS:
        return told
    left_s = (count - done) / rate
    return f"{told}, about {f'{left_s / 60:.0f} min' if left_s >= 90 else f'{left_s:.0f} s'} left"

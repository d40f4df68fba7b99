"""A campaign from its file to its table of runs: plans, runs in slots, goes on where it was interrupted."""

from __future__ import annotations

import errno
import math
import threading
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from care_core.collect.adaptive import Known, choose
from care_core.collect.campaign import Campaign, parameter_file_names
from care_core.collect.journal import Done, Journal
from care_core.collect.leftovers import end_leftovers
from care_core.collect.mission import GRACE_S, RUNS, fly
from care_core.collect.sampling import (
    Planned,
    at_reference,
    kind_of,
    new_among,
    one_at_a_time,
    points,
    repeat_of,
    run_seed,
    with_repeats,
)
from care_core.configs.driven import parameter_value, readable
from care_core.configs.edit import Wanted, apply_changes
from care_core.errors import CareError, UsageError
from care_core.progress import Progress
from care_core.records import Struct, field
from care_core.tables.rows import ABOUT, CONDITIONS, KIND, TableRow, check_table_path, write_rows, write_table

TABLE = "runs.csv"


_LOOK_S = 0.2
"""How often an interruption is looked for."""
_PACE_RUNS = 3
"""So many runs say how long the rest will take."""
_FIRST_ROUND = 2
"""Adaptive: so many runs an option are spread over the ranges before any is chosen."""


class Collected(Struct, eq=False):
    """What there is of a campaign: the plan so far, and the runs that are over."""

    campaign: Campaign
    folder: Path
    planned: Mapping[int, Planned]
    done: Mapping[int, Done]
    resumed: int = 0
    """Runs that an earlier call had made."""
    stopped: str = ""
    """Why it stopped before its end; '' where it did not."""

    @property
    def rows(self) -> list[TableRow]:
        return [row for number in sorted(self.done) for row in self.done[number].rows]

    @property
    def failed(self) -> list[Done]:
        return [self.done[number] for number in sorted(self.done) if self.done[number].failure]

    @property
    def table(self) -> Path:
        return self.folder / TABLE

    @property
    def missed(self) -> dict[str, int]:
        """How many of the missions missed each objective by a fixed threshold; only objectives that have one."""
        counts: Counter[str] = Counter()
        for row in self.rows:
            counts.update(missed(row, self.campaign))
        return {o.name: counts[o.name] for o in self.campaign.schema.objectives if o.fixed is not None}


def missed(row: TableRow, campaign: Campaign) -> list[str]:
    """The objectives with a fixed threshold that a mission missed."""
    return [
        objective.name
        for objective in campaign.schema.objectives
        if objective.fixed is not None
        and isinstance(value := row[objective.name], (int, float))
        and not objective.fixed.met(value)
    ]


def first_round(campaign: Campaign) -> list[Planned]:
    """The runs that are planned before anything is known: all of them, unless sampling is adaptive."""
    space, count = campaign.space, campaign.runs
    if campaign.sampling == "adaptive":
        count = min(count, max(_FIRST_ROUND * len(space.axes), campaign.batch) + 1)
    wanted = new_among(count, campaign.repeats, campaign.reference)
    if campaign.sampling == "one_at_a_time":
        configs = one_at_a_time(space, wanted)
    else:
        method = "sobol" if campaign.sampling == "adaptive" else campaign.sampling
        configs = points(space, method, wanted, campaign.at_reference, campaign.seed)
    return with_repeats(space, configs, count, campaign.repeats, campaign.seed, campaign.reference)


def collect(campaign: Campaign, folder: Path, *, retry_failed: bool = False, progress: Progress) -> Collected:
    """Make every run of a campaign that was not made yet, and write the table of runs.

    Args:
        folder: of the journal, the runs and the table; made where it is not there.
        retry_failed: make runs once more that an earlier call gave up.

    Raises:
        CareError: the folder is another campaign's or in use, a parameter file cannot hold an option, no plan is
            possible.
        KeyboardInterrupt: after what was under way was ended and the table of what there is was written.
    """
    _check_parameters(campaign)
    folder.mkdir(parents=True, exist_ok=True)
    with Journal.open(folder, campaign.digest) as journal:
        if not journal.planned:
            journal.plan(first_round(campaign))
        again = {number for number, done in journal.done.items() if done.failure} if retry_failed else set()
        found = Collected(campaign, folder, journal.planned, journal.done, len(journal.done) - len(again))
        check_table_path(found.table)
        work = _Work(found, journal, again, progress)
        end_leftovers(folder / RUNS, GRACE_S)
        try:
            while not found.stopped:
                work.make([run for n, run in sorted(journal.planned.items()) if n not in journal.done or n in again])
                if found.stopped or len(journal.planned) >= campaign.runs or campaign.sampling != "adaptive":
                    break
                journal.plan(_next_round(found))
        except BaseException:
            with suppress(CareError):  # a full disk is told of once
                _write(found)
            raise
        _write(found)
    return found


def _write(found: Collected) -> None:
    """The table, where a run gave a row. The seed that a command takes tells which runs met the same conditions, else
    their date has to."""
    schema = found.campaign.schema
    if not found.rows:
        return
    if not any("{seed}" in word for word in found.campaign.command):
        write_table(found.table, found.rows, schema)
        return
    rows = [{**row, CONDITIONS: found.planned[n].seed} for n in sorted(found.done) for row in found.done[n].rows]
    write_rows(found.table, rows, [*ABOUT, CONDITIONS, *schema.variables], KIND)


def _check_parameters(campaign: Campaign) -> None:
    """Find out before the first run whether the parameter files can hold every option. Raises CareError."""
    parameter_file_names(campaign.parameters)
    wanted = [
        Wanted(axis.option, parameter, parameter_value(axis.option, campaign.space.reference[axis.name]))
        for axis in campaign.space.axes
        for parameter in readable(axis.option)
    ]
    apply_changes(campaign.parameters, wanted)


def _next_round(found: Collected) -> list[Planned]:
    """What an adaptive campaign runs next, repeats among it."""
    campaign, before = found.campaign, len(found.planned)
    numbers = range(before + 1, min(before + campaign.batch, campaign.runs) + 1)
    kinds = {number: kind_of(number, campaign.repeats, campaign.reference) for number in numbers}
    configs = iter(
        choose(
            campaign.space,
            _known(found),
            sum(kind == "new" for kind in kinds.values()),
            at_reference=campaign.at_reference,
            seed=run_seed(campaign.seed, before),
            apart=campaign.tell_apart,
        )
    )
    repeated = {run.repeats for run in found.planned.values()} - {None}
    again = sum(kind_of(number, campaign.repeats, campaign.reference) == "repeat" for number in range(1, before + 1))
    originals = (n for n, run in sorted(found.planned.items()) if run.repeats is None and n not in repeated)
    planned = []
    for number in numbers:
        if kinds[number] == "reference":
            planned.append(at_reference(campaign.space, number, campaign.seed))
            continue
        original = next(originals, None) if kinds[number] == "repeat" else None
        if original is not None:
            planned.append(repeat_of(found.planned[original], number, campaign.seed, before=again))
            again += 1
        elif (config := next(configs, None)) is not None:
            planned.append(Planned(number, config, run_seed(campaign.seed, number)))
    return planned


def _known(found: Collected) -> Known:
    """Configurations and objectives of the runs so far, as driven."""
    rows = [row for row in found.rows if all(row[axis.name] is not None for axis in found.campaign.space.axes)]
    reference = found.campaign.space.reference
    configs = [{**reference, **{a.name: _number(row[a.name]) for a in found.campaign.space.axes}} for row in rows]
    objectives = [objective.name for objective in found.campaign.schema.objectives]
    return Known(configs, {name: [_number(row[name]) for row in rows] for name in objectives})


def _number(value: Any) -> float:
    return float(value) if isinstance(value, (int, float)) else math.nan


class _Work(Struct, eq=False):
    """Runs made in slots, and what is said of them."""

    found: Collected
    journal: Journal
    again: set[int]
    progress: Progress
    stop: threading.Event = field(default_factory=threading.Event)
    since: float = field(default_factory=time.monotonic)
    now: int = 0
    """Runs made by this call."""
    in_a_row: int = 0
    """Runs that failed one after the other."""

    def make(self, runs: Sequence[Planned]) -> None:
        """Make these runs; on an interruption those under way are ended and the others not begun."""
        if not runs:
            return
        campaign = self.found.campaign
        free: SimpleQueue[int] = SimpleQueue()
        for slot in range(campaign.slots):
            free.put(slot)
        self._say()
        with ThreadPoolExecutor(campaign.slots) as pool:
            try:
                left = iter(runs)
                under_way = {self._begin(pool, run, free) for _, run in zip(range(campaign.slots), left, strict=False)}
                while under_way:
                    ended, under_way = wait(under_way, timeout=_LOOK_S, return_when=FIRST_COMPLETED)
                    for one in ended:
                        self._keep(one.result())
                    if not self.found.stopped:
                        under_way |= {self._begin(pool, run, free) for _, run in zip(ended, left, strict=False)}
            except BaseException:
                self.stop.set()
                raise

    def _begin(self, pool: ThreadPoolExecutor, run: Planned, free: SimpleQueue[int]) -> Future[Done]:
        return pool.submit(self._fly, run, free)

    def _fly(self, run: Planned, free: SimpleQueue[int]) -> Done:
        slot = free.get()
        try:
            return fly(self.found.campaign, run, self.found.folder, slot, self.stop, afresh=run.number in self.again)
        except OSError as err:
            hint = "Put it right and give the same command again: the runs that are done are kept."
            message = f"Run {run.number} cannot be made: {err.strerror}."
            if err.errno in (errno.ENOSPC, errno.EDQUOT):
                hint = "Make room and give the same command again: the runs that are done are kept."
                message = f"The disk is full: run {run.number} is not counted."
            raise UsageError(message, hint=hint, where=str(err.filename or "")) from err
        finally:
            free.put(slot)

    def _keep(self, done: Done) -> None:
        self.journal.add(done)
        self.again.discard(done.run)
        self.now += 1
        self.in_a_row = self.in_a_row + 1 if done.failure else 0
        if self.in_a_row >= self.found.campaign.stop_after:
            self.found.stopped = f"{self.in_a_row} runs failed one after the other, the last: {done.failure}"
        elif self._ignores():
            self.found.stopped = "no run drove the values that were asked: does the command read {params}?"
        self._say()

    def _ignores(self) -> bool:
        """Whether the robot takes no notice of its parameter file: runs off the reference, none of them as asked."""
        off = [
            (names, set(done.ignored))
            for number, done in self.found.done.items()
            if done.rows and (names := self._off_reference(self.found.planned[number]))
        ]
        return len(off) >= self.found.campaign.stop_after and all(names <= ignored for names, ignored in off)

    def _off_reference(self, run: Planned) -> set[str]:
        space = self.found.campaign.space
        return {axis.name for axis in space.axes if run.config[axis.name] != space.reference[axis.name]}

    def _say(self) -> None:
        total = self.found.campaign.runs if self.found.campaign.sampling == "adaptive" else len(self.found.planned)
        done = len(self.found.done) - len(self.again)
        failed = f", {len(self.found.failed)} failed" if self.found.failed else ""
        self.progress(f"{done} of {total} runs{failed}{self._left(total - done)}", done / total)

    def _left(self, runs: int) -> str:
        if self.now < _PACE_RUNS or runs <= 0:
            return ""
        left_s = (time.monotonic() - self.since) / self.now * runs
        words = f"{left_s / 3600:.1f} h" if left_s >= 5400 else f"{left_s / 60:.0f} min" if left_s >= 90 else ""
        return f", about {words or f'{left_s:.0f} s'} left"

"""One run of a campaign: parameter file, the operator's command with its time limit and retries, the log it leaves.

Every attempt has a folder of its own (`runs/0007/2`) with the parameter files, what the command said (`command.log`),
and how it ended (`ended.json`). An attempt that ended before the program was killed is read, not made again; one that
was under way is left as it is, and the next attempt begins in a new folder.
"""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path

from care_core.collect import guard
from care_core.collect.campaign import Campaign, parameter_file_names
from care_core.collect.journal import Done
from care_core.collect.leftovers import LOGS_VARIABLE, end_leftovers
from care_core.collect.sampling import Planned
from care_core.configs.driven import parameter_value, readable, same_value
from care_core.configs.edit import Wanted, apply_changes
from care_core.errors import CareError, ConfigError
from care_core.files import open_regular, read_small_text, write_atomically
from care_core.logs.finding import logs_below
from care_core.records import Record
from care_core.run import Setting
from care_core.starting import script_command
from care_core.tables.rows import TableRow, rows_of
from care_core.text import shortened

RUNS = "runs"
RECORD, OUTPUT, LOGS = "ended.json", "command.log", "logs"

_LOOK_S = 0.1
"""How often a command under way is looked at for a stop."""
GRACE_S = 5.0
"""Time that a command has to close its log when it is ended."""
_LEAST_BYTES = 256 * 1024
"""With less than this left the disk is full: what a mission wrote then is not believed to be whole."""
_TOLD = 300
"""Characters of a command's last words that are told."""


class StoppedError(Exception):
    """The campaign is being stopped; nothing is to be recorded of this run."""


class _Ended(Record):
    """How an attempt ended: its folder, and why it is of no use ('' where it is)."""

    folder: Path
    time_s: float
    failure: str


def fly(
    campaign: Campaign, run: Planned, folder: Path, slot: int, stop: threading.Event, *, afresh: bool = False
) -> Done:
    """Make a run and read its logs.

    Args:
        folder: of the campaign.
        slot: number from 0 that no other run under way has.
        stop: when it is set, the command is ended.
        afresh: whatever an earlier call left is not looked at.

    Raises:
        StoppedError: `stop` was set.
        OSError: the attempt could not be written down, or the disk is full: nothing is to be recorded of this run.
    """
    place = folder / RUNS / f"{run.number:04d}"
    earlier = None if afresh else _ended_before(place)
    made: list[_Ended] = [] if earlier is None else [earlier]
    while not made or (made[-1].failure and len(made) <= campaign.retries):
        made.append(_attempt(campaign, run, place, slot, stop))
    last = made[-1]
    time_s = round(sum(one.time_s for one in made), 3)
    if last.failure:
        return Done(run.number, len(made), time_s, failure=last.failure)
    return _read(campaign, run, last.folder, len(made), time_s)


def write_parameters(campaign: Campaign, config: Mapping[str, float], folder: Path) -> tuple[Path, ...]:
    """The campaign's parameter files with a configuration put in. Raises ConfigError where one cannot hold it."""
    broken = campaign.space.broken(config)
    if broken is not None:  # whatever planned it, nothing outside the limits gets any further
        raise ConfigError(f"The configuration breaks the limit '{broken}' and is not driven.", where=str(folder))
    wanted = [
        Wanted(axis.option, parameter, parameter_value(axis.option, config[axis.name]))
        for axis in campaign.space.axes
        for parameter in readable(axis.option)
    ]
    edited = apply_changes(campaign.parameters, wanted)
    paths = tuple(folder / name for name in parameter_file_names(campaign.parameters))
    for path, file in zip(paths, edited, strict=True):
        write_atomically(path, file.after)
    return paths


def command_words(campaign: Campaign, run: Planned, params: Path, logs: Path, slot: int) -> list[str]:
    """The command with its placeholders filled in."""
    values: dict[str, str] = {
        **{name: f"{value:.7g}" for name, value in run.config.items()},
        "params": str(params),
        "logs": str(logs),
        "run": str(run.number),
        "seed": str(run.seed),
        "slot": str(slot),
        "python": sys.executable,
    }
    return [word.format_map(values) for word in campaign.command]


def _ended_before(place: Path) -> _Ended | None:
    """The last attempt of an earlier call, where it ended well before that call was killed."""
    attempts = _attempts(place)
    if not attempts:
        return None
    last = _ending(attempts[-1])
    return None if last is None or last.failure else last


def _attempts(place: Path) -> list[Path]:
    numbered = [path for path in place.glob("*") if path.name.isdigit()] if place.is_dir() else []
    return sorted(numbered, key=lambda path: int(path.name))


def _attempt(campaign: Campaign, run: Planned, place: Path, slot: int, stop: threading.Event) -> _Ended:
    if stop.is_set():
        raise StoppedError
    before = _attempts(place)
    folder = place / str(int(before[-1].name) + 1 if before else 1)
    logs = folder / LOGS
    place.mkdir(parents=True, exist_ok=True)
    _check_room(place)
    logs.mkdir(parents=True)
    params = write_parameters(campaign, run.config, folder)[0]
    words = command_words(campaign, run, params.absolute(), logs.absolute(), slot)
    environment = {
        **os.environ,
        "CARE_PARAMS": str(params.absolute()),
        LOGS_VARIABLE: str(logs.absolute()),
        "CARE_RUN": str(run.number),
        "CARE_SEED": str(run.seed),
        "CARE_SLOT": str(slot),
    }
    is_late = _run(words, campaign, environment, folder, stop)
    try:
        _check_room(folder)
    except OSError:
        (folder / RECORD).unlink(missing_ok=True)  # so that it is made again
        raise
    if is_late:
        return _Ended(folder, campaign.time_limit_s, f"the command took longer than {campaign.time_limit_s:g} s")
    return _ending(folder) or _Ended(folder, 0.0, "the command was ended from outside")


def _run(
    words: Sequence[str], campaign: Campaign, environment: Mapping[str, str], folder: Path, stop: threading.Event
) -> bool:
    """Run the command until it ends; whether it took too long. Raises StoppedError, and OSError where how it ended
    cannot be written down."""
    guarded = script_command(guard.__file__, str(GRACE_S), str((folder / RECORD).absolute()), *words)
    with (folder / OUTPUT).open("wb") as output:
        process = subprocess.Popen(
            guarded,
            stdin=subprocess.PIPE,  # closed by the system however this program ends
            stdout=output,
            stderr=subprocess.STDOUT,
            cwd=campaign.folder,
            env=dict(environment),
            start_new_session=True,  # Ctrl+C is this program's to handle
        )
    left_s = campaign.time_limit_s
    try:
        while left_s > 0 and not stop.is_set():
            try:
                _check_guard(process.wait(min(_LOOK_S, left_s)), folder)
                return False
            except subprocess.TimeoutExpired:
                left_s -= _LOOK_S
    finally:
        process.communicate()
        if process.returncode < 0:  # the guard was killed
            end_leftovers(folder, GRACE_S, session=process.pid)
    if stop.is_set():
        raise StoppedError
    # It may have ended in the last moment.
    return not (folder / RECORD).exists()


def _check_guard(code: int, folder: Path) -> None:
    """Raises OSError where a guard says that it could not write down how its command ended."""
    if code > guard.NO_RECORD:
        number = code - guard.NO_RECORD
        raise OSError(number, os.strerror(number), str(folder / RECORD))


def _check_room(folder: Path) -> None:
    """Raises OSError where the disk of a folder is full."""
    room = os.statvfs(folder)
    if room.f_bavail * room.f_frsize < _LEAST_BYTES or (room.f_files and not room.f_favail):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(folder))


def _ending(folder: Path) -> _Ended | None:
    """How an attempt ended by itself; None where it did not."""
    try:
        record = json.loads(read_small_text(folder / RECORD))
    except (OSError, ValueError):
        return None
    if "error" in record:
        return _Ended(folder, 0.0, f"the command could not be started: {record['error']}")
    code, time_s = int(record["code"]), float(record["time_s"])
    if code != 0:
        how = f"exit code {code}" if code > 0 else f"signal {-code}"
        return _Ended(folder, time_s, f"the command failed ({how}){_last_words(folder / OUTPUT)}")
    if not logs_below(folder / LOGS):
        return _Ended(folder, time_s, f"the command left no log in {{logs}}{_last_words(folder / OUTPUT)}")
    return _Ended(folder, time_s, "")


def _last_words(output: Path) -> str:
    with open_regular(output) as stream:
        stream.seek(max(0, output.stat().st_size - 4096))
        lines = stream.read().decode("utf-8", "replace").split("\n")
    said = [line.strip() for line in lines if line.strip()]
    return f": {shortened(said[-1], _TOLD)}" if said else ""


def _read(campaign: Campaign, run: Planned, folder: Path, attempts: int, time_s: float) -> Done:
    """The rows of a run's logs; what is wrong with one log does not lose the others."""
    params = [folder / name for name in parameter_file_names(campaign.parameters)]
    # What no log holds was driven as asked: the file is what the command was given.
    assumed = {
        parameter: Setting(parameter, parameter_value(axis.option, run.config[axis.name]), str(params[0]))
        for axis in campaign.space.axes
        for parameter in readable(axis.option)
    } | _fixed(campaign)
    rows: list[TableRow] = []
    reasons: list[str] = []
    logs = logs_below(folder / LOGS)
    for log in logs:
        try:
            rows += rows_of(log, campaign.schema, assumed)
        except CareError as err:
            reasons.append(f"{log.name}: {err.message}")
        except Exception as err:  # a defect met in one log must not lose the campaign
            reasons.append(f"{log.name}: unexpected {type(err).__name__}: {err}")
    named = tuple(str(log) for log in logs)
    if not rows:
        return Done(run.number, attempts, time_s, named, failure="; ".join(reasons) or "the log holds no mission")
    return Done(run.number, attempts, time_s, named, tuple(rows), "", tuple(reasons), _ignored(campaign, run, rows))


def _fixed(campaign: Campaign) -> dict[str, Setting]:
    """What options that never vary are, where no log holds them."""
    varied = {axis.name for axis in campaign.space.axes}
    return {
        parameter: Setting(parameter, parameter_value(option, campaign.space.reference[option.name]), "reference")
        for option in campaign.schema.options
        if option.name in campaign.space.reference and option.name not in varied
        for parameter in readable(option)
    }


def _ignored(campaign: Campaign, run: Planned, rows: Sequence[TableRow]) -> tuple[str, ...]:
    """Options that the log says were driven otherwise than asked."""
    return tuple(
        axis.name
        for axis in campaign.space.axes
        if any(not same_value(row[axis.name], run.config[axis.name]) for row in rows)
    )

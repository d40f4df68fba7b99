"""What an expert needs to look at a run, in one small zip: reports, parameters as driven, the signals that count, what
the robot's software said, versions, and what is missing. The log is only read, and does not go in.
"""

from __future__ import annotations

import platform
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from care_core.application.open_run import OpenRun, log_of
from care_core.application.plotting import ranked, sources_of, thinned
from care_core.application.redaction import ELSEWHERE, parameters_of, redactor_of
from care_core.application.reporting import report_of
from care_core.application.shared_parameters import may_go
from care_core.application.sharing import Sharing
from care_core.application.signals import Line, Source, lines_of
from care_core.application.viewing import messages_of
from care_core.errors import CareError
from care_core.outputs import BUNDLE_FOLDER
from care_core.records import Record, replace
from care_core.run import Setting, Unavailable, profile_title
from care_core.text import clean, csv_table, log_time

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from care_core.numbers import Floats

LARGEST = 2_000_000
"""Bytes of a bundle: what forums take as an attachment, and a field link sends in a minute."""
_RESERVE = 20_000
"""Bytes for the list of the files in the zip, and for what is said of signals in the end."""
_MOST_SIGNALS = 80
_MOST_MESSAGES = 5_000
_ROWS = (1_000_000, 50_000, 20_000, 10_000, 5_000, 2_000, 1_000, 300)
"""Values of a signal at most; the first number that lets the bundle keep its size."""
_NO_DATE = (1980, 1, 1, 0, 0, 0)
"""The least that a zip can say: the same run gives the same bundle."""

_PLACES = re.compile(
    r"(^|[_./])(LAT|LNG|LON|LATITUDE|LONGITUDE|DATUM|ORIG(IN\w*)?|INITIAL_POSE\w*)(_|\d|$)"
    r"|_OPOS_|MAG_DECL|COMPASS_DEC$|GND_(ABS_)?PRESS|FIELD_ELV|TERR_ALT",
    re.IGNORECASE,
)
"""Parameters that tell a place: coordinates, declination, and the air pressure at the start, which is a height."""


class Bundle(Record):
    """A zip, and what is in it by name with its size in bytes as it lies there."""

    content: bytes
    files: Mapping[str, int]
    missing: tuple[str, ...]


def bundle_of(case: OpenRun, sharing: Sharing, version: str) -> Bundle:
    """Pack a case, as far as it goes to others, below `LARGEST` bytes."""
    named = _without_folders(case)
    told = list(_missing(sharing.of(named)))
    files = {
        "report.html": report_of(named, "html", sharing),
        "report.md": report_of(named, "markdown", sharing),
        "report.json": report_of(named, "json", sharing),
        "versions.txt": "".join(f"{line}\n" for line in _versions(sharing.of(named), version)),
    }
    name, parameters, left_out = _parameters(named, sharing)
    if parameters:
        files[name] = parameters
    else:
        told.append("parameters: the log holds none")
    told += [f"parameters: {left_out} that tell a place or name a vehicle were left out"] if left_out else []
    files["messages.csv"] = _messages(named, sharing)
    room = LARGEST - _RESERVE - sum(len(_packed({name: text})) for name, text in files.items())
    signals, thinning = _signals(named, sharing, room)
    told += thinning
    files |= signals
    files = {"README.txt": _readme(named, sharing, sorted(files), told), **files}
    content = _packed(files)
    with ZipFile(BytesIO(content)) as archive:
        sizes = {one.filename.partition("/")[2]: one.compress_size for one in archive.infolist()}
    return Bundle(content, sizes, tuple(told))


def _without_folders(case: OpenRun) -> OpenRun:
    """The case without the folders that its log lay in."""
    run = case.diagnosis.run
    log = replace(run.log, path=Path(run.log.path).name)
    profile = case.diagnosis.profile
    profile = replace(profile, origin=ELSEWHERE if profile.origin else "")
    return replace(case, diagnosis=replace(case.diagnosis, profile=profile, run=replace(run, log=log)))


def _packed(files: Mapping[str, str]) -> bytes:
    stream = BytesIO()
    with ZipFile(stream, "w", ZIP_DEFLATED, compresslevel=9) as archive:
        for name, text in files.items():
            entry = ZipInfo(f"{BUNDLE_FOLDER}/{name}", _NO_DATE)
            entry.compress_type, entry.external_attr = ZIP_DEFLATED, 0o644 << 16
            archive.writestr(entry, text.encode())
    return stream.getvalue()


def _versions(case: OpenRun, version: str) -> Iterator[str]:
    from care_core.diagnose.verdict import fit_text

    run, profile = case.diagnosis.run, case.diagnosis.profile
    yield f"care {version}"
    yield f"Python {platform.python_version()} on {platform.system()} {platform.machine()}"
    yield fit_text(
        profile_title(f"{profile.name} {profile.version}", profile.origin) if profile.name else "", profile.fit
    )
    yield f"log format {run.log.format}"
    yield from (clean(f"{name} {value}") for name, value in sorted(run.log.facts.items()))


def _missing(case: OpenRun) -> Iterator[str]:
    """What the log does not hold, or could not be judged by."""
    diagnosis = case.diagnosis
    run = diagnosis.run
    for result in diagnosis.objectives:
        if result.status == "not_evaluated":
            yield clean(f"{result.name}: not evaluated, {result.reason}")
    unknown: dict[str, list[str]] = {}
    for name, value in {**run.metrics, **run.context}.items():
        if isinstance(value, Unavailable):
            unknown.setdefault(f"{value.reason}{f' ({value.hint})' if value.hint else ''}", []).append(name)
    yield from (clean(f"{', '.join(names)}: {reason}") for reason, names in unknown.items())
    names = [variable.name for variable in case.options if variable.name not in run.config]
    if names:
        yield clean(f"options that no source holds: {', '.join(names)}")
    yield from (clean(f"log: {damage.what}") for damage in run.log.damage)
    yield from (clean(f"profile: {reason}") for reason in diagnosis.profile.fit.reasons)


def _parameters(case: OpenRun, sharing: Sharing) -> tuple[str, str, int]:
    """Name and text of the configuration as driven, and how many parameters do not go to others."""
    from care_core.configs.formats import format_for, write_params

    settings = {name: history[-1] for name, history in log_of(case).settings().items()}
    kept = {name: one for name, one in settings.items() if sharing.positions or not _PLACES.search(name)}
    if sharing.anonymous:
        kept = _anonymous(case, kept, sharing)
    format = format_for(case.diagnosis.run.log.format, settings)
    text = write_params(kept, format, {}) if kept else ""
    return f"parameters{format.suffix}", text, len(settings) - len(kept)


def _anonymous(case: OpenRun, settings: Mapping[str, Setting], sharing: Sharing) -> dict[str, Setting]:
    """Settings that name nobody. The names of firmware's parameters are its own; those of ROS have namespaces."""
    text, options = sharing.text(case), parameters_of(case)
    kept = {name: one for name, one in settings.items() if may_go(name, options, case.diagnosis.run.log.format)}
    named = {(text(name) if "/" in name else name): one for name, one in kept.items()}
    return {
        name: replace(one, name=name)
        for name, one in named.items()
        if not isinstance(one.value, str) or text(one.value) == one.value
    }


def _messages(case: OpenRun, sharing: Sharing) -> str:
    """What the robot's software said, in order of time, as CSV."""
    hider = redactor_of(case, positions=sharing.positions) if sharing.anonymous else None
    text = hider.said if hider else sharing.text(case)
    try:
        messages = messages_of(case)
    except CareError:  # a log without any
        messages = []
    rows = ((round(one.time_s, 3), one.kind, text(one.text)) for one in messages[:_MOST_MESSAGES])
    return csv_table([("time_s", "kind", "text"), *rows])


def _signals(case: OpenRun, sharing: Sharing, room: int) -> tuple[dict[str, str], list[str]]:
    """A CSV a channel with its signals over the whole log, in at most `room` bytes; and what was left out for that."""
    groups, _ = ranked(case, sharing)
    sources = list(dict.fromkeys(source for group in groups for source in sources_of(group)))
    span = 0.0, max(log_of(case).duration_s, 1e-9)
    found = {name: line for name, line in lines_of(case, sources[:_MOST_SIGNALS], span).items() if line is not None}
    text = sharing.text(case)
    told = [f"signals: {len(sources) - _MOST_SIGNALS} more are in the log"] if len(sources) > _MOST_SIGNALS else []
    for most in _ROWS:
        tables = {f"signals/{_file_name(text(name))}.csv": _table(part, span, most) for name, part in _channels(found)}
        if len(_packed(tables)) <= room:
            longest = max((len(line[0]) for line in found.values()), default=0)
            thin = f"signals: at most {most} values each, the least and the greatest of every part kept"
            return tables, told + ([thin] if longest > most else [])
    return {}, [*told, "signals: none, there was no room"]


def _channels(found: Mapping[Source, Line]) -> Iterator[tuple[str, dict[str, Line]]]:
    """The signals by channel."""
    names = dict.fromkeys(channel for channel, _ in found)
    for name in names:
        yield name, {field: line for (channel, field), line in found.items() if channel == name}


def _table(lines: Mapping[str, Line], span: tuple[float, float], most: int) -> str:
    """Signals of a channel as CSV, a row a message. Thinned where it has more than so many."""
    import numpy as np

    times = np.unique(np.concatenate([t for t, _ in lines.values()]))
    if len(times) > most:
        kept = [line[0][_in_order(line, span, most)] for line in lines.values()]
        times = np.unique(np.concatenate(kept))
    columns = [_aligned(line, times) for line in lines.values()]
    rows = (
        ",".join((f"{time_s:.3f}", *("" if value != value else f"{value:.6g}" for value in row)))
        for time_s, *row in zip(times, *columns, strict=True)
    )
    return csv_table([("time_s", *lines)]) + "".join(f"{row}\n" for row in rows)


def _in_order(line: Line, span: tuple[float, float], most: int) -> NDArray[np.intp]:
    """Places of the values that are kept; those of a log whose times go back are in their order of time."""
    import numpy as np

    t, values = line
    order = np.argsort(t, kind="stable")
    return order[thinned(t[order], values[order], span, most)]


def _aligned(line: Line, times: Floats) -> Floats:
    """The values at these times, NaN where the signal has none; of two at one time the last."""
    import numpy as np

    column = np.full(len(times), np.nan)
    t, values = line
    place = np.searchsorted(times, t)
    is_there = (place < len(times)) & (times[np.minimum(place, len(times) - 1)] == t)
    column[place[is_there]] = values[is_there]
    return column


def _file_name(channel: str) -> str:
    """A channel as the name of a file."""
    return re.sub(r"[^\w-]+", "_", channel).strip("_") or "channel"


def _readme(case: OpenRun, sharing: Sharing, names: Sequence[str], told: Iterable[str]) -> str:
    """What lies here, and what does not."""
    log = case.diagnosis.run.log
    name = "a log" if sharing.anonymous else clean(log.path)
    positions = "with positions" if sharing.positions else "without positions"
    who = "Names, hosts, serial numbers, paths and dates were left out." if sharing.anonymous else ""
    lines = [
        f"What an expert needs to look at a run: {name}, {log.format}, {log_time(log.duration_s)}.",
        f"Packed by 'care bundle' {positions}. {who}".rstrip(),
        "",
        "Files",
        *(f"  {one:<32}  {_DESCRIBED.get(Path(one).stem.partition('/')[0], _OF_SIGNALS)}" for one in names),
        "",
        "Times are seconds from the start of the log. Values of ArduPilot and PX4 are as in their logs, ROS in SI.",
        "report.html opens in any browser and needs no network.",
        "",
        "What is missing",
        *([f"  {line}" for line in told] or ["  nothing that was looked for"]),
    ]
    return "\n".join(lines) + "\n"


_OF_SIGNALS = "signals of one channel, CSV"
_DESCRIBED = {
    "report": "what happened, causes, fix",
    "parameters": "configuration as driven",
    "messages": "what the robot's software said, CSV",
    "versions": "program, profile, firmware",
}

"""Text that came out of a log or a file, made safe to show: nothing in it may steer a terminal or a document."""

from __future__ import annotations

import math
import re
import shlex
import textwrap
import unicodedata
from collections.abc import Iterable, Sequence

WIDTH = 80
"""Columns of plain text for people."""
_MINUTES_FROM_S = 100.0
"""A time of so many seconds is told in minutes as well: a watch and a video count those."""


def clean(text: str) -> str:
    """The text on one line; a character that could steer a terminal is written as its escape, such as `\\x1b`."""
    if text.isascii() and text.isprintable():
        return text
    return "".join(_shown(character) for character in text)


def _shown(character: str) -> str:
    if character in "\n\r\t":
        return " "
    # Not printable are control, format (bidirectional overrides, zero width), private and unassigned characters.
    return character if character.isprintable() or unicodedata.category(character) == "Zs" else ascii(character)[1:-1]


_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\uff1d", "\uff0b", "\uff0d", "\uff20")
"""What a spreadsheet takes for the beginning of a formula (OWASP, CSV injection), full-width signs too."""


def cell(text: str) -> str:
    """The text as a cell of a table, made safe: a spreadsheet computes what begins as a formula does."""
    made = clean(text)
    return f"'{made}" if text.startswith(_FORMULA) or made.lstrip().startswith(_FORMULA) else made


def csv_table(rows: Iterable[Iterable[object]]) -> str:
    """Rows as CSV, the first one the header: texts are cells that no spreadsheet computes, numbers stay numbers, and of
    nothing a cell is empty. Every table that is written as CSV comes from here."""
    import csv
    from io import StringIO

    stream = StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerows([cell(value) if isinstance(value, str) else value for value in row] for row in rows)
    return stream.getvalue()


def command(*words: str, note: str = "") -> str:
    """A line for a shell or a ground station, in which each word stays one word, whatever it holds."""
    line = shlex.join(map(clean, words))
    return f"{line}  # {clean(note)}" if note else line


def shortened(text: str, longest: int) -> str:
    """The text, or as much of its beginning with a sign that it goes on; no word is cut but one that is very long."""
    if len(text) <= longest:
        return text
    head = text[: longest - 2].rpartition(" ")[0]
    return f"{head if len(head) > longest / 2 else text[: longest - 3].rstrip()}..."


def number_of(count: int, noun: str) -> str:
    """So many of something: 1 log, 2 logs."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def none_of_logs(count: int) -> str:
    """The subject of a sentence about logs that all fail: No log, or None of the 3 logs."""
    return "No log" if count == 1 else f"None of the {count} logs"


def listed(names: Sequence[str], last: str = "and") -> str:
    """`a`, `a and b`, `a, b and c`; nothing of none."""
    return f" {last} ".join([", ".join(names[:-1]), *names[-1:]]) if len(names) > 1 else "".join(names)


def first_of(names: Sequence[str], most: int) -> str:
    """The names, of more than so many the first, with how many there are beside."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return f"{', '.join(names[:most])}{more}"


def figures(value: float, digits: int = 3) -> str:
    """A measured number with as many digits as it is worth, a large one without a power of ten: 0.0123, 71800."""
    return f"{float(f'{value:.{digits}g}'):.15g}"


_INSIDE_FIGURE = re.compile(
    r"(?<=\d) (?=(?:[mu]?s|[ckm]?m|m/s\S*|[mk]?V|m?Ah?|Wh?|k?Hz|kg|deg\S*|rad\S*)(?![\w/]))"
    r"|(?<=\d s) (?=\(\d+:\d)"
)
"""The space between a number and its unit, and before its minutes: no line ends there."""


def wrapped(text: str, first: str = "", rest: str | None = None, width: int = WIDTH) -> list[str]:
    """The text, made safe, in lines of at most `width` columns; `rest` indents the later ones, as wide as `first` if
    not given."""
    indent = " " * len(first) if rest is None else rest
    together = _INSIDE_FIGURE.sub("\u00a0", clean(text))
    lines = textwrap.wrap(together, width, initial_indent=first, subsequent_indent=indent, break_on_hyphens=False)
    return [line.replace("\u00a0", " ") for line in lines]  # what must stand on one line was held together by them


_NUMBERS = re.compile(r"\d+(?:\.\d+)?")


def but_for_numbers(text: str) -> str:
    """The text with a sign for every number in it: what differs in nothing else says one thing again."""
    return _NUMBERS.sub("#", text)


LONG_S = 600.0
"""From here on a time of a log has the form of minutes alone where there is little room."""


def log_time(time_s: float | None, digits: int = 1) -> str:
    """A time of a log, or how long one lasts, wherever people read it: 61.3 s, from 100 s on 312.4 s (5:12)."""
    if time_s is None or not math.isfinite(time_s):
        return "an unknown time"
    shown = round(time_s, digits) + 0.0  # no minus before a zero
    minutes = f" ({_minutes(time_s)})" if abs(shown) >= _MINUTES_FROM_S else ""
    return f"{shown:.{digits}f} s{minutes}"


def times_until(count: int, last_s: float) -> str:
    """How often something was said, and when last, behind the first of it; nothing of what was said once."""
    return f" ({count} times until {log_time(last_s, 0)})" if count > 1 else ""


def log_times(times_s: Sequence[float | None]) -> list[str]:
    """The same as the cells of a column: all of one width, second under second."""
    cells = ["?" if time_s is None or not math.isfinite(time_s) else log_time(time_s) for time_s in times_s]
    pairs = [cell.partition(" (") for cell in cells]
    widths = [
        max((len(pair[0]) for pair in pairs), default=0),
        max((len(pair[1] + pair[2]) for pair in pairs), default=0),
    ]
    return [f"{head:>{widths[0]}}{gap + tail:<{widths[1]}}" for head, gap, tail in pairs]


def seconds(time_s: float | None) -> str:
    """A time of a log where a column of the app is narrow: 61.3 s, from ten minutes on 12:05, from an hour 1:02:05."""
    if time_s is None or not math.isfinite(time_s):
        return "?"
    return f"{time_s:.1f} s" if abs(time_s) < LONG_S else _minutes(time_s)


def _minutes(time_s: float) -> str:
    """5:12, from an hour on 1:02:05, to the nearest second as all that is told of a time."""
    minutes, rest = divmod(round(abs(time_s)), 60)
    hours, minutes = divmod(minutes, 60)
    sign = "-" if time_s < 0 else ""
    return f"{sign}{hours}:{minutes:02}:{rest:02}" if hours else f"{sign}{minutes}:{rest:02}"


def percent(share: float) -> str:
    """A share as a percentage that never claims certainty it has not."""
    if 0.995 <= share < 1:
        return ">99%"
    return "<1%" if 0 < share < 0.005 else f"{share:.0%}"

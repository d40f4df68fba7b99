"""Parameter files of QGroundControl: five columns with tabs between them."""

from __future__ import annotations

from pathlib import Path

from care_core.ecosystems.dialect import Dialect

HEADER = "# Vehicle-Id Component-Id Name Value Type"
_COLUMNS = 5


def is_row(line: str) -> bool:
    """Whether a line has the five columns."""
    words = line.split("\t")
    return len(words) == _COLUMNS and all(word.strip().isdigit() for word in (words[0], words[1], words[4]))


def _is_written(first: str, text: str, path: Path) -> bool:
    return is_row(first) or (not first and HEADER in text)


QGC_PARAMS = Dialect(
    name="qgc-params",
    suffix=".params",
    module="care_core.ecosystems.px4.parameter_file",
    is_written=_is_written,
    line=r"(\s*\d+\t\d+\t{key}\t)([^\t]+)(\t.*)",
)

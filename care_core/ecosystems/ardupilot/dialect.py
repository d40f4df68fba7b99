"""Parameter files of ArduPilot: a name and a value on a line."""

from __future__ import annotations

import re
from pathlib import Path

from care_core.ecosystems.dialect import Dialect

_PARAMETER_LINE = re.compile(r"[A-Z][A-Z0-9_]*(\s*,\s*|\s+)[-+.\w]+(\s|$)")


def _is_written(first: str, text: str, path: Path) -> bool:
    return _PARAMETER_LINE.match(first.strip()) is not None


ARDUPILOT_PARAM = Dialect(
    name="ardupilot-param",
    suffix=".param",
    module="care_core.ecosystems.ardupilot.parameter_file",
    is_written=_is_written,
    line=r"(\s*{key}(?:\s*,\s*|\s+))([^\s,#]+)(.*)",
)

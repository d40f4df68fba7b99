"""Which rooms the path of a log and a threshold pass through in `care triage`: `python -m benchmarks.tools.rooms`.

Every function of the project that is called with the value (alone, in a list or a mapping, or as the bound of a
`Threshold`) is noted. Prints, per value, how many functions of each room are given it, and how often the log is opened.
"""

from __future__ import annotations

import contextlib
import io
import sys
from collections import Counter
from pathlib import Path
from types import FrameType
from typing import Any

ROOT = Path(sys.path[0] or ".").resolve()
LOG = ROOT / "samples" / "arducopter_failed.BIN"
BOUND = 141.40625


def _holds(argument: Any, value: Path | float) -> bool:
    if type(argument) is dict:
        return any(_holds(part, value) for part in argument.values())
    if type(argument) in (list, tuple):
        return any(_holds(part, value) for part in argument)
    if isinstance(argument, str):
        return argument.rpartition("=")[2] == str(value)
    if isinstance(argument, (Path, float)):
        return argument == value
    return hasattr(argument, "op") and getattr(argument, "value", None) == value


def _room(frame: FrameType) -> str | None:
    try:
        parts = Path(frame.f_code.co_filename).relative_to(ROOT).parts
    except ValueError:
        return None
    return "/".join(parts[:2]) if len(parts) > 2 else parts[-1]


def walked(value: Path | float, *words: str) -> dict[str, set[str]]:
    """Per room the functions that are called with the value by `care` with these words."""
    from care_tui.cli import command_line

    found: dict[str, set[str]] = {}

    def note(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and (room := _room(frame)) is not None and room != "benchmarks/tools":
            code = frame.f_code
            given = [frame.f_locals.get(name) for name in code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]]
            if any(_holds(argument, value) for argument in given):
                found.setdefault(room, set()).add(f"{code.co_filename}:{code.co_name}")

    sys.setprofile(note)
    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
            command_line(words)(list(words), prog_name="care")
    finally:
        sys.setprofile(None)
    return found


def main() -> None:
    words = ("triage", str(LOG), "--threshold", f"mission_time={BOUND}", "--no-history")
    for name, value in (("path of a log", LOG), ("threshold", BOUND)):
        counts = Counter({room: len(functions) for room, functions in walked(value, *words).items()})
        told = ", ".join(f"{room} {count}" for room, count in counts.most_common())
        print(f"{name}: {len(counts)} rooms, {sum(counts.values())} functions: {told}")


if __name__ == "__main__":
    main()

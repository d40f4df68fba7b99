"""Whether two checkouts give the same answer for the same bytes.

    python -m benchmarks.tools.same_answer BEFORE AFTER LOG_OR_FOLDER... [--save FILE]

BEFORE and AFTER are checkouts of the project, or answers that an earlier run saved. Each triages every log, in a
process of its own checkout; the JSON report and the text must be the same to the byte, and a refusal the same sentence.
Prints the logs whose answers differ with the first line that does, and ends with 1 where there is one.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from itertools import zip_longest
from pathlib import Path

from care_core.logs.finding import find_logs

ANSWER = """
import json, sys
import care_core
from care_core.errors import CareError
for path in sys.stdin.read().splitlines():
    try:
        case = care_core.triage(path)
        answer = [case.report("json"), case.report("text")]
    except CareError as err:
        answer = [f"{type(err).__name__}: {err}"]
    print(json.dumps([path, answer]), flush=True)
"""


def answers(source: Path, logs: Sequence[Path]) -> dict[str, list[str]]:
    """Per log what a checkout says of it, or said when it was saved."""
    if source.is_file():
        return dict(json.loads(line) for line in source.read_text(encoding="utf-8").splitlines())
    with tempfile.TemporaryDirectory() as home:
        private = {"XDG_DATA_HOME": home, "XDG_CONFIG_HOME": home, "XDG_CACHE_HOME": home, "OPENBLAS_NUM_THREADS": "1"}
        ended = subprocess.run(
            [sys.executable, "-c", ANSWER],
            input="\n".join(map(str, logs)),
            stdout=subprocess.PIPE,
            text=True,
            check=True,
            cwd=source,  # what is imported is looked for here first
            env={**os.environ, **private, "PYTHONPATH": str(source.resolve())},
        )
    return dict(json.loads(line) for line in ended.stdout.splitlines())


def first_difference(before: Iterable[str], after: Iterable[str]) -> str | None:
    """The first line that is not the same in two answers, None where they are the same."""
    for old, new in zip_longest("\n".join(before).splitlines(), "\n".join(after).splitlines(), fillvalue="(nothing)"):
        if old != new:
            return f"- {old.strip()}\n    + {new.strip()}"
    return None


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    parser.add_argument("logs", type=Path, nargs="+")
    parser.add_argument("--save", type=Path, help="keep the answers of BEFORE here")
    asked = parser.parse_args()
    logs = [log.resolve() for log in find_logs(asked.logs)]
    before = answers(asked.before, logs)
    if asked.save is not None:
        asked.save.write_text("".join(f"{json.dumps(pair)}\n" for pair in before.items()), encoding="utf-8")
    after = answers(asked.after, logs)
    differing = {log: found for log in after if (found := first_difference(before[log], after[log])) is not None}
    for log, found in differing.items():
        print(f"{log}\n    {found}")
    print(f"{len(after)} logs, {len(differing)} of them answered differently")
    raise SystemExit(bool(differing))


if __name__ == "__main__":
    main()

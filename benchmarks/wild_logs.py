"""What `care` makes of every file in a folder of logs and configuration files from the wild.

    python -m benchmarks.wild_logs [--shared DIR]

Prints a table of file and outcome (read, read with damage, or refused with a sentence), and how a triage of it ends.
"""

from __future__ import annotations

import argparse
import os
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import care_core
from care_core.diagnose.verdict import verdict_of
from care_core.errors import CareError
from care_core.logs.finding import is_recorder_folder as is_recording
from care_core.records import Record


class Outcome(Record):
    """What became of a file: `read`, `damage` or `refused`; a sentence; the exit code of its triage; the seconds."""

    kind: str
    sentence: str
    triage_code: int
    seconds: float


def wild_files(folder: Path) -> Iterator[Path]:
    """Every file and every ROS 2 bag folder, without what describes them."""
    for path in sorted(folder.iterdir()):
        if path.is_dir():
            if is_recording(path):
                yield path
            yield from wild_files(path)
        elif path.suffix != ".md":
            yield path


def outcome_of(path: Path) -> Outcome:
    """Inspect a file and triage it. Whatever is not a CareError is a defect, and rises."""
    started = time.perf_counter()
    kind, sentence = _inspected(path)
    code = _triaged(path)
    return Outcome(kind, sentence, code, time.perf_counter() - started)


def _inspected(path: Path) -> tuple[str, str]:
    try:
        document = care_core.inspect(path)
    except CareError as err:
        return "refused", f"{err.message} {err.hint}".strip()
    damage = document.log.damage
    count = sum(channel.count for channel in document.channels)
    held = f"{document.log.format}, {count} messages, {document.parameters.count} parameters"
    return ("damage", f"{held}; {damage[0].what}") if damage else ("read", held)


def _triaged(path: Path) -> int:
    try:
        return int(verdict_of(care_core.triage(path).diagnosis).exit_code)
    except CareError as err:
        return int(err.exit_code)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shared", type=Path, default=os.environ.get("CARE_SHARED"), help="folder that holds logs/")
    args = parser.parse_args()
    if args.shared is None:
        parser.error("give --shared DIR or set CARE_SHARED")
    folder = args.shared / "logs"
    kinds: Counter[str] = Counter()
    print("| file | outcome | what | triage ends with | s |\n|---|---|---|---|---|")
    for path in wild_files(folder):
        found = outcome_of(path)
        kinds[found.kind] += 1
        sentence = found.sentence.replace("|", "\\|")
        print(f"| {path.relative_to(folder)} | {found.kind} | {sentence} | {found.triage_code} | {found.seconds:.1f} |")
    print(", ".join(f"{count} {kind}" for kind, count in kinds.most_common()))


if __name__ == "__main__":
    main()

"""Was it the hardware? Missions with a failing part that missed a goal are driven again with that part whole.

    python -m nav2_robot.again TRUTH... -o DIR [--drive COMMAND] [--care COMMAND]

TRUTH is what `--truth` wrote of a mission in which something failed. One that missed a goal is driven again with the
same parameter file and seed and no failure. `care` is asked about the log of each: does it name the part that failed,
does it advise to change a parameter? What was driven before is not driven again.
"""

from __future__ import annotations

import argparse
import json
import shlex
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

NAMED: Mapping[str, str] = {
    "laser_dead": "laser", "laser_noise": "laser", "laser_stuck": "laser",
    "odom_jump": "localisation", "odom_drift": "localisation",
    "drive_weak": "drive", "drive_one_side": "drive", "stall": "drive",
    "blocked": "blocked", "battery": "battery", "command_loss": "commands",
}  # fmt: skip
"""What fails, and the kind of finding that names it."""

WORDS = {True: "reached", False: "missed", None: "-"}

Truth = Mapping[str, Any]


def read(path: str | Path) -> Truth:
    """A truth. Raises ArgumentTypeError where there is none."""
    try:
        return dict(json.loads(Path(path).read_text(encoding="utf-8")))
    except (OSError, ValueError) as err:
        raise argparse.ArgumentTypeError(f"{path}: {err}") from err


def missed(truth: Truth) -> bool:
    return bool(truth["reached"] < len(truth["world"]["goals"]))


def reaches_all(truth: Truth, folder: Path, command: Sequence[str]) -> bool | None:
    """Whether the mission reaches all its goals when nothing fails; None where it could not be driven."""
    place = folder / str(truth["seed"])
    known = place / "known.json"
    if not known.exists():
        place.mkdir(parents=True, exist_ok=True)
        words = ("--params", truth["params"], "--seed", str(truth["seed"]), "--logs", str(place), "--truth", str(known))
        with (place / "command.log").open("wb") as output:
            subprocess.run([*command, *words], check=False, stdout=output, stderr=output)
    return not missed(read(known)) if known.exists() else None


def answer(truth: Truth, command: Sequence[str]) -> dict[str, Any]:
    """What care makes of the log: its first finding, whether it names the part, the options that it would change."""
    words = [*command, "triage", truth["log"], "--json", "--no-history"]
    told = json.loads(subprocess.run(words, check=False, capture_output=True, text=True).stdout)
    findings = [finding for finding in told["findings"] if finding["severity"] != "info"]
    return {
        "finding": findings[0]["title"] if findings else "",
        "named": NAMED[truth["failure"]["kind"]] in [finding["kind"] for finding in findings],
        "advised": [change["option"] for change in told["fix"]["changes"]] if told["fix"] else [],
    }


def main(words: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("truths", type=read, nargs="+", metavar="TRUTH")
    parser.add_argument("-o", "--out", type=Path, required=True, metavar="DIR", help="where they are driven again")
    parser.add_argument("--drive", default=f"{sys.executable} -m nav2_robot", help="what drives a mission")
    parser.add_argument("--care", default="care")
    given = parser.parse_args(words)
    found = []
    for truth in (truth for truth in given.truths if truth["failure"]):
        told = answer(truth, shlex.split(given.care))
        whole = reaches_all(truth, given.out, shlex.split(given.drive)) if missed(truth) else None
        found.append({**told, "missed": missed(truth), "whole": whole})
        print(f"{truth['seed']}  {truth['failure']['kind']:14}  {'missed' if missed(truth) else 'reached':7}  "
              f"{WORDS[whole]:7}  {told['finding'] or '-'}  "
              f"{' '.join(told['advised'])}".rstrip(), flush=True)  # fmt: skip
    show(found)
    return 0


def show(found: Sequence[Mapping[str, Any]]) -> None:
    """Print how many of the missions with a failing part, and of those that missed a goal, were answered rightly."""
    for title, some in (("all", found), ("missed a goal", [one for one in found if one["missed"]])):
        counts = {word: sum(bool(one[word]) for one in some) for word in ("finding", "named", "advised")}
        print(f"{title}: {len(some)}, with a finding {counts['finding']}, the part named {counts['named']}, "
              f"advised a parameter {counts['advised']}")  # fmt: skip
    again = [one["whole"] for one in found if one["whole"] is not None]
    print(f"driven again whole: {len(again)}, reached all {sum(again)}")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

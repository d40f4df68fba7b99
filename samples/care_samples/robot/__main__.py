"""The robot as a command.

python -m care_samples.robot --params FILE --log FILE [--seed N]   one mission; .bag is ROS 1, .mcap is ROS 2
python -m care_samples.robot --start DIR [--ros 2]                 the files to begin with

A mission that fails is a mission: the command ends with 0, and with 2 only where it could not drive.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from care_samples.parameters import read_parameters
from care_samples.robot.mission import DEFAULTS, Robot
from care_samples.robot.ranges import RANGES
from care_samples.robot.recording import NODE, write_bag, write_mcap
from care_samples.robot.starting import write_robot
from care_samples.robot.world import GOALS, Conditions


def main(words: list[str]) -> int:
    """Drive, or write the files to begin with; the exit code."""
    asked = _arguments(words)
    if asked.start is not None:
        write_robot(asked.start, asked.ros)
        return 0
    try:
        parameters = read_parameters(asked.params, NODE, DEFAULTS, RANGES)
    except (OSError, ValueError) as err:
        print(f"robot: {asked.params}: {err}", file=sys.stderr)
        return 2
    story = Robot(parameters, Conditions.of(asked.seed)).run()
    write = write_mcap if asked.log.suffix == ".mcap" else write_bag
    write(asked.log, story, parameters)
    ended_s, _, outcome, text = story.results[-1]
    why = f": {text}" if text else ""
    print(f"{story.reached} of {len(GOALS)} goals, the last {outcome} at {ended_s:.0f} s{why}")
    return 0


def _arguments(words: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m care_samples.robot", description=__doc__.partition("\n")[0])
    parser.add_argument("--params", type=Path, help="parameters of ROS 1 or ROS 2, YAML")
    parser.add_argument("--log", type=Path, help="the log to write: .bag or .mcap")
    parser.add_argument("--seed", type=int, default=1, help="what the run meets")
    parser.add_argument("--start", type=Path, metavar="DIR", help="write the files to begin with")
    parser.add_argument("--ros", type=int, choices=(1, 2), default=1, help="for --start")
    asked = parser.parse_args(words)
    if asked.start is None and (asked.params is None or asked.log is None):
        parser.error("--params and --log belong together")
    if asked.log is not None and asked.log.suffix not in (".bag", ".mcap"):
        parser.error("a log ends in .bag or .mcap")
    return asked


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

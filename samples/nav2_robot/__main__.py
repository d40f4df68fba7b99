"""The robot as a command.

python -m nav2_robot --params FILE --logs DIR [--seed N]     one mission, recorded as DIR/drive.mcap
python -m nav2_robot --start DIR                             the parameter file to begin with

A stand-in drives, without ROS 2: see `nav2_robot.standin`.

A mission that fails is a mission: the command ends with 0, and with 2 only where it could not drive.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from care_samples.parameters import write_start
from nav2_robot import parameters
from nav2_robot.failures import Failure
from nav2_robot.recorder import Recorder
from nav2_robot.robot import Robot
from nav2_robot.standin import StandIn
from nav2_robot.world import WORLDS, Conditions, described

_FILES = ("nav2.yaml",)


def main(words: list[str]) -> int:
    """Drive, or write the file to begin with; the exit code."""
    asked = _arguments(words)
    if asked.start is not None:
        here = Path(__file__).parent / "start"
        write_start({name: (here / name).read_text(encoding="utf-8") for name in _FILES}, asked.start)
        return 0
    try:
        settings = parameters.read(asked.params)
        asked.logs.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as err:
        print(f"nav2_robot: {asked.params}: {err}", file=sys.stderr)
        return 2
    conditions = Conditions.of(asked.seed, asked.world)
    robot = Robot(conditions, asked.fail, asked.skid)
    with Recorder(asked.logs / "drive.mcap") as recorder:
        reached = StandIn(robot, settings, recorder).run()
    if asked.truth is not None:
        told = {"reached": reached, "recorded_s": robot.now_s, **_truth(robot)}
        asked.truth.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    print(f"{reached} of {len(conditions.world.goals)} goals, {robot.now_s:.0f} s")
    return 0


def _truth(robot: Robot) -> dict[str, Any]:
    """What the simulator knows and no topic tells."""
    failure = robot.failing.failure
    return {
        "collisions": robot.collisions, "distance_m": round(robot.distance, 3), "passed": robot.passed,
        "energy_j": round(robot.battery.drawn_j, 1), "pose": robot.pose, "odometry": robot.odometry,
        "failure": None if failure is None else vars(failure), "failed_at_s": robot.failing.began_s,
        "world": described(robot.world),
    }  # fmt: skip


def _arguments(words: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m nav2_robot", description=__doc__.partition("\n")[0])
    parser.add_argument("--params", type=Path, help="Nav2's parameter file")
    parser.add_argument("--logs", type=Path, metavar="DIR", help="where drive.mcap is written")
    parser.add_argument("--seed", type=int, default=1, help="what the run meets, its world and goals too")
    parser.add_argument("--world", choices=sorted(WORLDS), default="", help="this world, whatever the seed says")
    parser.add_argument("--skid", action="store_true", help="skid steering in place of two driven wheels")
    parser.add_argument("--fail", type=_failure, metavar="KIND:AT:SIZE", help="what fails, s after the first command")
    parser.add_argument("--truth", type=Path, metavar="FILE", help="what the simulator knows of the run, as JSON")
    parser.add_argument("--start", type=Path, metavar="DIR", help="write the parameter file to begin with")
    asked = parser.parse_args(words)
    if asked.start is None and (asked.params is None or asked.logs is None):
        parser.error("--params and --logs belong together")
    return asked


def _failure(text: str) -> Failure:
    try:
        return Failure.parse(text)
    except ValueError as err:
        raise argparse.ArgumentTypeError(str(err)) from err


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

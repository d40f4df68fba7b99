"""The robot as a command.

python -m nav2_robot --params FILE --logs DIR [--seed N]     one mission with Nav2, which it starts with this file
python -m nav2_robot ... --stand-in                          the same recording without ROS 2; nothing to learn from
python -m nav2_robot --start DIR                             the files to begin with

A mission that fails is a mission: the command ends with 0, and with 2 only where it could not drive.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import sys
from pathlib import Path
from typing import Any

from care_samples.parameters import write_start
from nav2_robot import parameters
from nav2_robot.failures import Failure
from nav2_robot.parameters import Parameters
from nav2_robot.recorder import Recorder
from nav2_robot.robot import Robot
from nav2_robot.standin import StandIn
from nav2_robot.world import WORLDS, Conditions, described

_DRAWN = "drawn"
_CONTROLLER_HZ = 20.0
"""Nav2's, where the file does not say."""
_PROFILES = {"dwb": "nav2", "mppi": "nav2-mppi", "rpp": "nav2-rpp"}
"""By the controller that Nav2 drives with; each has a parameter file of its name in `start`."""


def main(words: list[str]) -> int:
    """Drive, or write the files to begin with; the exit code."""
    asked = _arguments(words)
    if asked.start is not None:
        write_start(_start_files(asked.controller), asked.start)
        return 0
    try:
        settings = parameters.read(asked.params)
        asked.logs.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as err:
        print(f"nav2_robot: {asked.params}: {err}", file=sys.stderr)
        return 2
    conditions = Conditions.of(asked.seed, asked.world)
    failure = Failure.drawn(random.Random(f"failure {asked.seed}")) if asked.fail == _DRAWN else asked.fail
    robots: list[Robot] = []

    def make() -> Robot:
        robots.append(Robot(conditions, failure, asked.skid))
        return robots[-1]

    path = asked.logs / "drive.mcap"
    told = _stand_in(path, make(), settings) if asked.stand_in else _nav2(path, make, settings, asked)
    if told is None:
        path.unlink(missing_ok=True)
        return 2
    if asked.truth is not None:
        driven = {"seed": asked.seed, "params": str(asked.params.absolute()), "log": str(path.absolute())}
        asked.truth.write_text(json.dumps({**driven, **told, **_truth(robots[-1])}, indent=1) + "\n", encoding="utf-8")
    print(f"{told['reached']} of {len(conditions.world.goals)} goals, {told['mission_s']:.0f} s")
    return 0


def _start_files(controller: str) -> dict[str, str]:
    """The files to begin with, by name: what Nav2 is driven with, and a campaign of its profile."""
    here = Path(__file__).parent / "start"
    campaign = (here / "campaign.yaml").read_text(encoding="utf-8")
    return {
        "nav2.yaml": (here / f"{controller}.yaml").read_text(encoding="utf-8"),
        "campaign.yaml": campaign.replace("profile: nav2\n", f"profile: {_PROFILES[controller]}\n"),
    }


def _stand_in(path: Path, robot: Robot, settings: Parameters) -> dict[str, Any]:
    with Recorder(path) as recorder:
        reached = StandIn(robot, settings, recorder).run()
    return {"reached": reached, "mission_s": robot.now_s}


def _nav2(path: Path, make: Any, settings: Parameters, asked: argparse.Namespace) -> dict[str, Any] | None:
    try:
        from nav2_robot.node import Drive, NavigationError
        from nav2_robot.servers import Servers

        os.environ["ROS_DOMAIN_ID"] = str(asked.domain)
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        hz = parameters.number(settings, "/controller_server", "controller_frequency", _CONTROLLER_HZ)
        outputs = asked.outputs or asked.logs
        outputs.mkdir(parents=True, exist_ok=True)
        with Servers(asked.params, outputs) as servers, Recorder(path) as recorder:
            drive = Drive(make, recorder, hz, asked.speedup)
            try:
                told = drive.run(servers)
            finally:
                drive.close()
    except (ImportError, FileNotFoundError, NavigationError) as err:
        print(f"nav2_robot: {err}", file=sys.stderr)
        return None
    except KeyboardInterrupt:
        print("nav2_robot: interrupted", file=sys.stderr)
        return None
    return {**vars(told), "reached": told.reached}


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
    parser.add_argument("--fail", type=_failure, metavar="KIND:AT:SIZE", 
                        help="what fails, s after the first command; 'drawn': what the seed says")  # fmt: skip
    parser.add_argument("--stand-in", action="store_true", help="drive without ROS 2, to try the files")
    parser.add_argument("--domain", type=int, default=42, help="ROS domain; another for each drive at a time")
    parser.add_argument("--speedup", type=float, default=1.0, help="simulated time to real time, at most")
    parser.add_argument("--outputs", type=Path, metavar="DIR", help="where the servers' outputs go; beside the log")
    parser.add_argument("--truth", type=Path, metavar="FILE", help="what the simulator knows of the run, as JSON")
    parser.add_argument("--start", type=Path, metavar="DIR", help="write the files to begin with")
    parser.add_argument("--controller", choices=sorted(_PROFILES), default="dwb",
                        help="with --start: the controller that Nav2 drives with")  # fmt: skip
    asked = parser.parse_args(words)
    if asked.start is None and (asked.params is None or asked.logs is None):
        parser.error("--params and --logs belong together")
    return asked


def _failure(text: str) -> Failure | str:
    try:
        if text == _DRAWN:
            return text
        return Failure.parse(text)
    except ValueError as err:
        raise argparse.ArgumentTypeError(str(err)) from err


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

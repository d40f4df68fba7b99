"""The lander's arm as a command.

python -m care_samples.arm --params FILE --log FILE.bag [--seed N]   one excavation
python -m care_samples.arm --start DIR                               the files to begin with

An excavation that fails is a mission: the command ends with 0, and with 2 only where it could not run.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from care_samples.arm.excavation import DEFAULTS, RANGES, Arm, Soil, commands_in_words
from care_samples.arm.recording import NODE, write_bag
from care_samples.parameters import read_parameters, write_start

START = Path(__file__).parent / "start"


def main(words: list[str]) -> int:
    """Dig, or write the files to begin with; the exit code."""
    parser = argparse.ArgumentParser(prog="python -m care_samples.arm", description=__doc__.partition("\n")[0])
    parser.add_argument("--params", type=Path, help="parameters of ROS 1, YAML")
    parser.add_argument("--log", type=Path, help="the bag to write")
    parser.add_argument("--seed", type=int, default=1, help="what the run meets")
    parser.add_argument("--start", type=Path, metavar="DIR", help="write the files to begin with")
    asked = parser.parse_args(words)
    if asked.start is not None:
        write_start({path.name: path.read_text(encoding="utf-8") for path in sorted(START.iterdir())}, asked.start)
        return 0
    if asked.params is None or asked.log is None:
        parser.error("--params and --log belong together")
    try:
        parameters = read_parameters(asked.params, NODE, DEFAULTS, RANGES)
    except (OSError, ValueError) as err:
        print(f"arm: {asked.params}: {err}", file=sys.stderr)
        return 2
    story = Arm(parameters, Soil.of(asked.seed)).run()
    write_bag(asked.log, story, parameters)
    for line in commands_in_words(story):
        print(line)
    print(f"{'sample taken' if story.is_success else 'no sample'}: {story.sample_cm3:.0f} cm3")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

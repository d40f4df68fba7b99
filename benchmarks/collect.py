"""Are faults of the bundled robot really repaired? A campaign, its model, new failed drives, and their fixes driven.

    python -m benchmarks.collect [--runs 300] [--faults 60] [--profile DIR]

`care collect` and `care train` make the model by command line. Every fault is a configuration in which some options are
off their reference, under conditions that no run of the campaign met. What is suggested is driven twice: under the
conditions of the failed drive, and under others. Beside it: the option that is furthest from its reference is put back,
and every option is.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

import care_core
from care_core import plain_yaml
from care_core.application.case import Request
from care_core.learn.skill import calibration_error, reliability
from care_core.profile.reading import read_schema
from care_core.profile.schema import Schema
from care_samples.robot.mission import DEFAULTS, GOAL_LIMIT_S, Robot
from care_samples.robot.recording import NODE, write_bag
from care_samples.robot.starting import write_robot
from care_samples.robot.world import GOALS, Conditions

OFF = 0.2
"""Share of the options of a field configuration that are off their reference."""
FIRST_SEED, NEXT_SEED = 50_000_000, 10_000_000
"""Beyond those of any campaign here; what is added for other conditions."""
SUGGESTED = "suggested values"

Config = Mapping[str, float]


def collected(folder: Path, runs: int) -> Path:
    """The folder of a profile trained on a campaign of so many runs."""
    start = folder / "courier"
    write_robot(start, 1)
    campaign = start / "campaign.yaml"
    data = plain_yaml.editable(campaign.read_text(encoding="utf-8"))
    data["runs"] = runs
    campaign.write_text(plain_yaml.written(data), encoding="utf-8")
    model = folder / "model"
    table, schema = start / "campaign" / "runs.csv", start / "profile.yaml"
    for words in (("collect", campaign), ("train", table, "--schema", schema, "-o", model)):
        subprocess.run([sys.executable, "-m", "care_tui", *map(str, words)], check=True)
    return model


def drive(config: Config, seed: int, schema: Schema, log: Path | None = None) -> bool:
    """Whether a drive meets every objective; recorded where `log` is given."""
    parameters = {schema.variables[name].parameters[0].removeprefix(f"/{NODE}/"): v for name, v in config.items()}
    story = Robot(parameters, Conditions.of(seed)).run()
    if log is not None:
        write_bag(log, story, {**DEFAULTS, **parameters})
    began_s, ended_s = story.goals[0][0], story.results[-1][0]
    t, volts, amps = np.array(story.battery).T
    inside = (t >= began_s) & (t <= ended_s)
    energy_wh = float(-(volts * amps)[inside].mean() * (ended_s - began_s) / 3600)
    slowest_s = max(r[0] - g[0] for g, r in zip(story.goals, story.results, strict=True))
    limits = {o.name: o.threshold for o in schema.objectives}
    met = {"mission_success": float(story.reached == len(GOALS) and slowest_s <= GOAL_LIMIT_S)}
    met |= {"mission_time": ended_s - began_s, "energy": energy_wh}
    return all(limit is not None and limit.met(met[name]) for name, limit in limits.items())


def field_configuration(schema: Schema, reference: Config, rng: np.random.Generator) -> dict[str, float]:
    """A configuration as it is met: most options at their reference, the others anywhere in their range."""
    config = dict(reference)
    for option in schema.options:
        if option.range is not None and rng.random() < OFF:
            config[option.name] = option.snap(rng.uniform(*option.range))
    return config


class Tally:
    """Per way of repairing a fault, whether it met everything under the same conditions, and under others."""

    def __init__(self) -> None:
        self.repaired: dict[str, list[tuple[bool, bool]]] = {}
        self.promised: list[tuple[float, bool]] = []
        self.sizes: list[int] = []

    def add(self, way: str, config: Config, seed: int, schema: Schema) -> bool:
        """Drive a configuration under the conditions of a fault and under others; whether the first met everything."""
        found = drive(config, seed, schema), drive(config, seed + NEXT_SEED, schema)
        self.repaired.setdefault(way, []).append(found)
        return found[0]

    def show(self, faults: int) -> None:
        """Print the shares of all faults."""
        print(f"{'repaired, of all faults':42s}{'same conditions':>16s}{'others':>8s}")
        for way, found in self.repaired.items():
            same, other = (sum(column) / faults for column in zip(*found, strict=True))
            print(f"  {way:40s}{same:16.0%}{other:8.0%}")
        p = np.array([promise for promise, _ in self.promised])
        met = np.array([float(kept) for _, kept in self.promised])
        print(f"advised in {len(p)} of {faults}: {met.mean():.2f} repaired under the same conditions, {p.mean():.2f} "
              f"promised; {np.median(self.sizes):g} options changed in the middle")  # fmt: skip
        print(f"calibration error {calibration_error(p, met):.3f}; promised, repaired, n:")
        for predicted, share, count in reliability(p, met):
            print(f"    {predicted:4.2f} {share:4.2f} {count:4d}")


def measure(profile: Path, faults: int) -> None:
    """Diagnose so many failed drives, drive what is suggested, and print what came of it."""
    schema = read_schema(profile / "profile.yaml")
    reference = {option.name: option.default for option in schema.options if option.default is not None}
    rng = np.random.default_rng(1)
    tally, driven, seen = Tally(), 0, 0
    with tempfile.TemporaryDirectory() as scratch:
        while seen < faults:
            driven += 1
            config, seed = field_configuration(schema, reference, rng), FIRST_SEED + driven
            log = Path(scratch) / f"{driven}.bag"
            if drive(config, seed, schema, log):
                continue
            seen += 1
            fix = care_core.triage(Request(log, str(profile))).diagnosis.fix
            if fix is not None:
                changes = {change.option.name: change.suggested for change in fix.changes}
                tally.promised.append((fix.p_fixed, tally.add(SUGGESTED, {**config, **changes}, seed, schema)))
                tally.sizes.append(len(changes))
            far = max(reference, key=lambda name: schema.variables[name].distance(config[name], reference[name]))
            tally.add("furthest option to its reference", {**config, far: reference[far]}, seed, schema)
            tally.add("every option to its reference", reference, seed, schema)
            tally.add("nothing changed", config, seed, schema)
    print(f"{seen} of {driven} drives failed")
    tally.show(seen)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=300, help="runs of the campaign")
    parser.add_argument("--faults", type=int, default=60)
    parser.add_argument("--profile", type=Path, help="one that is trained already")
    args = parser.parse_args()
    if args.profile is not None:
        measure(args.profile, args.faults)
        return
    with tempfile.TemporaryDirectory() as folder:
        measure(collected(Path(folder), args.runs), args.faults)


if __name__ == "__main__":
    main()

"""Do suggested values work when flown? Random faults of a simulated robot whose every mechanism is known.

    python -m benchmarks.fixes [--runs 60 250] [--faults 300]

The profile is trained on that many missions. Every fault is a random configuration that misses an objective; its fix is
flown twice: with the suggested values and with the same options back at their reference. The next mission meets
a share of the noise of the failed one, as the engine assumes.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from care_core.causal.model import UNKNOWN_CARRY_OVER
from care_core.diagnose.judging import judge
from care_core.diagnose.triage import diagnose
from care_core.learn.skill import calibration_error, reliability
from care_core.learn.train import train
from care_core.profile.model import write_model
from care_core.profile.store import Profile
from care_core.run import ProfileChoice
from tests.planted import DEFAULTS, SCHEMA, SETTINGS, draw_config, draw_noise, fly, fly_many, run_of

SAME = UNKNOWN_CARRY_OVER.same
CHOICE = ProfileChoice("planted", "1", "Simulated robot", "named by the benchmark")


def meets_all(config: Mapping[str, float], noise: Mapping[str, float]) -> bool:
    outcome = fly(config, noise)
    return all(o.threshold is not None and o.threshold.met(outcome[o.name]) for o in SCHEMA.objectives)


def next_noise(noise: Mapping[str, float], rng: np.random.Generator) -> dict[str, float]:
    """What the next mission meets: alike, not equal."""
    return {name: SAME * value + np.sqrt(1 - SAME**2) * rng.normal() for name, value in noise.items()}


def measure(runs: int, faults: int) -> None:
    """Train on `runs` missions, diagnose `faults` failed ones, fly their fixes and print what came of them."""
    rng = np.random.default_rng(runs)
    promised, fixed, reset, sizes, nearer = [], [], [], [], 0
    abstained = seen = 0
    with tempfile.TemporaryDirectory() as scratch:
        write_model(train(fly_many(runs), SCHEMA, SETTINGS), Path(scratch))
        profile = Profile(Path(scratch), SCHEMA)
        while seen < faults:
            config, noise = draw_config(rng), draw_noise(rng)
            if meets_all(config, noise):
                continue
            seen += 1
            fix = diagnose(judge(run_of(config, fly(config, noise)), SCHEMA, profile.model), profile, CHOICE).fix
            if fix is None:
                abstained += 1
                continue
            after = next_noise(noise, rng)
            changes = {change.option.name: change.suggested for change in fix.changes}
            promised.append(fix.p_fixed)
            fixed.append(meets_all({**config, **changes}, after))
            reset.append(meets_all({**config, **{name: DEFAULTS[name] for name in changes}}, after))
            sizes.append(len(changes))
            nearer += any(value != DEFAULTS[name] for name, value in changes.items())
    p, met = np.array(promised), np.array(fixed, dtype=float)
    print(f"\ntrained on {runs} missions: {seen} faults, {abstained} abstained, median changes {np.median(sizes):g}")
    print(f"  suggested values that fixed the fault: {met.mean():.2f} (promised {p.mean():.2f}); "
          f"the same options at their reference: {np.mean(reset):.2f}; {nearer} nearer to the run's")  # fmt: skip
    print(f"  calibration error {calibration_error(p, met):.3f}; predicted, fixed, n:")
    for predicted, seen_share, count in reliability(p, met):
        print(f"    {predicted:4.2f} {seen_share:4.2f} {count:4d}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, nargs="+", default=[60, 250], help="training missions")
    parser.add_argument("--faults", type=int, default=300)
    args = parser.parse_args()
    for runs in args.runs:
        measure(runs, args.faults)


if __name__ == "__main__":
    main()

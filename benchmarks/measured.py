"""What do the measurements of the log itself carry, where any parameter may be the cause?

    python -m benchmarks.measured FAULTS... [--most N]

Each folder holds failed missions of copters or rovers with `truth.jsonl`: which resets were really flown under the
conditions of the failure, and which repaired it. Every failure is told with all checks; without those of one
measurement at a time, and without the refusals to arm; with one of these alone; and without all of them: what is left
then is the causal map, the screening flights and the profile. Printed is in how many the first of the hypotheses, and
one of the first three, is a parameter (or a failed part) that repairs the mission.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Collection, Mapping
from pathlib import Path
from types import ModuleType
from unittest.mock import patch

from benchmarks.odds import Failure, failures
from care_core.ecosystems.ardupilot import checks, examining
from care_core.ecosystems.ardupilot.checks import settings

MEASUREMENTS: Mapping[str, tuple[ModuleType, ...]] = {
    "heading": (settings.heading, checks.compass),
    "battery": (settings.supply, settings.charge, checks.battery),
    "level": (settings.level, settings.standing),
    "hover": (settings.hover, settings.thrust_curve, checks.thrust),
    "outputs": (settings.outputs, settings.driven, checks.takeoff, checks.motor),
    "spectrum": (checks.spectrum, checks.rate_loop),
    "antenna": (checks.lever_arm,),
    "way home": (checks.way_home, checks.fence, checks.mission_height),
    "refusals": (checks.prearm,),
}
"""The checks of each: heading against course and estimator; volts and current; standing and level flight; throttle in
hover; outputs against what they bring about; gyros' noise against filters; where the GPS antenna is; fence, return and
landing against what was flown."""


def hits(folder: Path, most: int, without: Collection[str]) -> tuple[int, int, int]:
    """Failed missions, and how many of them have their cause first, and among the first three."""
    left_out = {module.CHECK for name in without for module in MEASUREMENTS[name]}
    with patch.object(examining, "CHECKS", tuple(check for check in checks.CHECKS if check not in left_out)):
        places = [_place(one) for one in failures(folder, most, None)]
    return len(places), sum(place == 0 for place in places), sum(place < 3 for place in places)


def _place(one: Failure) -> int:
    """How many hypotheses stand before the first that is true."""
    true = frozenset().union(*one.fixing)
    told = one.case.diagnosis.hypotheses
    names = [one.name if one.what == "parameter" else one.what for one in told]
    return next((place for place, name in enumerate(names) if name in true), len(names) + 3)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path, help="folders with truth.jsonl and logs")
    parser.add_argument("--most", type=int, default=10**9, help="so many failures of each")
    asked = parser.parse_args()
    os.environ["CARE_HISTORY"] = "off"  # simulated vehicles share a name, and a run of one is no good run of another
    ways: dict[str, Collection[str]] = {"all checks": ()}
    ways |= {f"without {name}": (name,) for name in MEASUREMENTS}
    ways |= {f"{name} alone": MEASUREMENTS.keys() - {name} for name in MEASUREMENTS}
    ways |= {"none of these": MEASUREMENTS.keys()}
    for way, without in ways.items():
        told = [hits(folder, asked.most, without) for folder in asked.folders]
        line = "   ".join(f"{n} failures: first {first}, in three {three}" for n, first, three in told)
        print(f"  {way:18s} {line}", flush=True)


if __name__ == "__main__":
    main()

"""How well extraction agrees with what was measured from outside, over the training logs of a profile.

    python -m benchmarks.extraction --shared FOLDER

FOLDER holds `data/<platform>/train.tar.xz` and `train.csv`. Prints one line per quantity.
"""

from __future__ import annotations

import argparse
import csv
import math
import tarfile
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from care_core.ecosystems.measures import MISSION_KINDS, Mission, find_extractor
from care_core.ecosystems.registry import register_measures, run_model
from care_core.logs.base import merge_needs
from care_core.logs.opening import open_log
from care_core.profile.reading import read_schema
from care_core.profile.schema import Schema
from care_core.run import Value, is_known

PROFILES = Path(__file__).resolve().parent.parent / "profiles"
TruthRow = Mapping[str, str]


class Check(NamedTuple):
    """A quantity that was also measured from outside: allowed difference, relative where `relative`."""

    quantity: str
    variable: str
    column: str
    tolerance: float
    wanted_share: float
    relative: bool = False
    floor: float = 0.0
    """Differences below this do not count, for relative checks of values near zero."""


ARDUCOPTER = (
    Check("mission success", "mission_success", "mission_success", 0.0, 1.0),
    Check("waypoints reached", "waypoints_reached", "waypoints", 0.0, 1.0),
    Check("armed time, s", "mission_time", "armed_time_s", 0.4, 1.0),
    Check("energy, Wh", "energy", "energy_wh", 0.05, 1.0),
    Check("path error max, m", "path_error_max", "path_err_max", 0.35, 0.95),
    Check("path error mean, m", "path_error_mean", "path_err_mean", 0.06, 0.9, relative=True, floor=0.05),
    Check("yaw error", "yaw_error", "yaw_err_rms", 0.06, 0.9, relative=True, floor=0.02),
    Check("velocity error", "velocity_error", "psc_vel_err_rms", 0.06, 0.9, relative=True, floor=0.02),
    Check("altitude error", "altitude_error", "psc_alt_err_rms", 0.06, 0.9, relative=True, floor=0.01),
    Check("vibration", "vibration", "vibe_mean", 0.06, 0.9, relative=True, floor=0.02),
    Check("mean speed", "mean_speed", "speed_mean", 0.06, 0.9, relative=True, floor=0.02),
    Check("lowest voltage, V", "min_voltage", "volt_min", 0.05, 0.95),
    Check("landing error, m", "landing_error", "end_dist_home", 0.35, 0.95),
)

MOVE_BASE = (
    Check("mission success", "mission_success", "mission_success", 0.0, 1.0),
    Check("goals reached", "goals_reached", "goals_reached", 0.0, 1.0),
    Check("rotate recoveries", "rotate_recoveries", "rotate_recovery", 0.0, 1.0),
    Check("clear recoveries", "clear_recoveries", "clear_costmap_recovery", 0.0, 1.0),
    Check("goals approached", "goals_approached", "rns", 1e-6, 0.99),
    Check("mission time, s", "mission_time", "mission_time", 0.5, 0.95),
    Check("energy, J", "energy_j", "energy_j", 0.03, 0.95, relative=True),
    Check("distance, m", "traveled_distance", "distance", 0.03, 0.95, relative=True, floor=0.05),
)


def main(argv: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shared", type=Path, required=True, help="folder that holds data/")
    parser.add_argument("--limit", type=int, default=None, help="only the first N logs")
    arguments = parser.parse_args(argv)
    check_arducopter(arguments.shared / "data", arguments.limit)
    check_move_base(arguments.shared / "data", arguments.limit)


def check_arducopter(data: Path, limit: int | None = None) -> None:
    """Agreement of every ArduCopter training log with its row of `train.csv`."""
    schema = read_schema(PROFILES / "arducopter" / "profile.yaml")
    with tempfile.TemporaryDirectory() as folder:
        unpack(data / "arducopter" / "train.tar.xz", Path(folder))
        rows = read_rows(data / "arducopter" / "train.csv")[:limit]
        begun = time.perf_counter()
        values = [mission_values(Path(folder) / "logs" / row["log"], schema) for row in rows]
        each_ms = (time.perf_counter() - begun) / len(rows) * 1000
    print(f"ArduCopter: {len(rows)} logs, {each_ms:.0f} ms each")
    print_agreement(rows, values, ARDUCOPTER)


def check_move_base(data: Path, limit: int | None = None) -> None:
    """Agreement of every move_base training bag with its row of `train.csv`, options included."""
    schema = read_schema(PROFILES / "move_base" / "profile.yaml")
    with tempfile.TemporaryDirectory() as folder:
        unpack(data / "move_base" / "train.tar.xz", Path(folder))
        rows = read_rows(data / "move_base" / "train.csv")[:limit]
        paths = [Path(folder) / "logs" / row["log"] for row in rows]
        begun = time.perf_counter()
        values = [mission_values(path, schema) for path in paths]
        each_ms = (time.perf_counter() - begun) / len(rows) * 1000
        wrong = sum(count_wrong_options(path, row, schema) for path, row in zip(paths, rows, strict=True))
    for one in values:
        energy_wh = one["energy"]
        one["energy_j"] = energy_wh * 3600 if is_known(energy_wh) else energy_wh
    driven = len(rows) * len(schema.options)
    print(f"move_base: {len(rows)} logs, {each_ms:.0f} ms each, {wrong} of {driven} option values wrong")
    print_agreement(rows, values, MOVE_BASE)


def count_wrong_options(path: Path, row: TruthRow, schema: Schema) -> int:
    """Options whose last value in the log is not the one that was driven."""
    settings = open_log(path).settings()
    driven = {option.name: settings[option.parameters[0]][-1].value for option in schema.options}
    return sum(not math.isclose(float(value), float(row[name]), rel_tol=1e-6) for name, value in driven.items())


def mission_values(path: Path, schema: Schema) -> dict[str, Value]:
    """Metrics and objectives of the last mission of a log, and no value withheld."""
    log = open_log(path)
    model = run_model(log)
    register_measures(schema.logs)
    kind = MISSION_KINDS[str(schema.mission["kind"])]
    extracts = {name: one.extract for name, one in schema.variables.items() if one.extract is not None}
    found = {name: find_extractor(extract.kind) for name, extract in extracts.items()}
    needs = [kind.needs(schema.mission), *(found[name].needs(extracts[name].args) for name in extracts)]
    missions = kind.missions(model, model.tables(merge_needs(needs)), schema.mission)
    if not missions:
        return {}
    last = missions[-1]
    settings = {name: history[-1].value for name, history in log.settings().items()}
    mission = Mission(model, last.tables, last.start_s, last.end_s, last.ended, last.spec, settings)
    return {name: found[name].compute(mission, extract.args) for name, extract in extracts.items()}


def unpack(archive: Path, folder: Path) -> None:
    with tarfile.open(archive) as stream:
        stream.extractall(folder, filter="data")


def read_rows(table: Path) -> list[dict[str, str]]:
    with table.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def print_agreement(
    rows: Sequence[TruthRow],
    values: Sequence[Mapping[str, Value]],
    checks: Sequence[Check],
    say: Callable[[str], None] = print,
) -> None:
    """One line per quantity: how many runs have both values, how far they differ, and whether that is enough."""
    say(f"{'quantity':22} {'runs':>5} {'lacking':>8} {'median':>8} {'p95':>8} {'within':>8} {'wanted':>7}")
    for check in checks:
        differences, lacking = [], 0
        for row, got in zip(rows, values, strict=True):
            if row[check.column] == "":
                continue
            value = got.get(check.variable)
            if not is_known(value):
                lacking += 1
                continue
            differences.append(_difference(value, float(row[check.column]), check))
        differences.sort()
        if not differences:
            say(f"{check.quantity:22} {0:5} {lacking:8}")
            continue
        share = sum(one <= check.tolerance for one in differences) / len(differences)
        middle, late = (differences[min(len(differences) - 1, int(p * len(differences)))] for p in (0.5, 0.95))
        verdict = "" if share >= check.wanted_share else "  BELOW"
        say(
            f"{check.quantity:22} {len(differences):5} {lacking:8} {middle:8.3f} {late:8.3f} {share:8.3f}"
            f" {check.wanted_share:7.2f}{verdict}"
        )


def _difference(value: float, truth: float, check: Check) -> float:
    off = abs(value - truth)
    if not check.relative:
        return off
    return 0.0 if off <= check.floor else off / max(abs(truth), math.ulp(1.0))


if __name__ == "__main__":
    main()

"""Retrains the bundled profiles from their data.

    python -m benchmarks.tools.train_profiles [--shared DIR] [--only NAME]... [--tables DIR]

Where the logs of a platform's missions are at hand they are ingested themselves; of planes and PX4 the table that was
made from them lies in `benchmarks/tables`. The others are published tables; the lander's arm is simulated anew by its
campaign.
"""

from __future__ import annotations

import argparse
import csv
import os
import subprocess
import sys
import tarfile
import tempfile
import time
from pathlib import Path

from care_core.files import bundled
from care_core.learn.card import write_card
from care_core.learn.table import read_table
from care_core.learn.train import TrainSettings, train
from care_core.logs.finding import find_logs
from care_core.profile.model import write_model
from care_core.profile.reading import read_schema
from care_core.profile.schema import Schema
from care_core.records import Record
from care_core.tables.ingest import ingest, journal_of
from care_core.tables.rows import write_table

RESAMPLES = 50
TABLES = Path(__file__).parents[1] / "tables"
"""Tables of runs whose logs are not at hand, made by `care ingest` and rounded to six digits."""


class Source(Record):
    """Where a profile's runs come from: archives of logs, or a table. `origin` goes into the model card."""

    paths: tuple[str, ...]
    origin: str
    hardware: str = ""
    """A table with the columns `tag` and `hardware`: logs in which hardware failed teach nothing about parameters."""
    table: str = ""
    """A table of `TABLES`, in place of `paths`."""
    simulation: str = ""
    """A module that writes a campaign of simulated missions and drives them, in place of `paths`."""


SOURCES = {
    "arducopter": Source(
        ("data/arducopter/train.tar.xz", "data/varied/table.tar.xz"),
        "Missions of the ArduCopter V4.5.4 firmware in its software-in-the-loop simulator, recorded by this project "
        "under random configurations and winds: 411 flights of one mission by one quadcopter, and those of 597 flights "
        "of 50 settings (mission, vehicle, site) in which no hardware failed; DataFlash logs, read by `care ingest`.",
        hardware="data/varied/table.csv",
    ),
    "ardurover": Source(
        ("data/rover/table.tar.xz", "data/rover/few.tar.xz"),
        "Missions of the ArduRover V4.5.4 firmware in its software-in-the-loop simulator, recorded by this project "
        "under random configurations: those of 239 drives of 30 settings (mission, steering, site) in which no "
        "hardware failed, and 365 of 42 others, of each the reference and, in half of the rest, one to three "
        "options off; DataFlash logs, read by `care ingest`.",
        hardware="data/rover/table.csv",
    ),
    "arduplane": Source(
        (),
        "Missions of the ArduPlane V4.5.4 firmware in its software-in-the-loop simulator, recorded by this project "
        "under random configurations and winds: 467 flights of 61 settings (mission with waits, turns of own radii, "
        "commanded airspeeds, climbs and returns, plane, site), of each mission the reference twice, and of the rest "
        "two thirds with one to three options off; DataFlash logs, read by `care ingest`.",
        table="arduplane.csv",
    ),
    "quadplane": Source(
        (),
        "Missions of the ArduPlane V4.5.4 firmware with a QuadPlane in its software-in-the-loop simulator, recorded by "
        "this project under random configurations and winds: 350 flights of 45 settings (mission with waits, turns of "
        "own radii, commanded airspeeds, climbs and returns, QuadPlane, site), of each mission the reference twice, "
        "and of the rest two thirds with one to three options off; DataFlash logs, read by `care ingest`.",
        table="quadplane.csv",
    ),
    "ardusub": Source(
        ("data/sub/table.tar.xz",),
        "Missions of the ArduSub firmware (of the source of release 4.5.4) in its software-in-the-loop simulator, "
        "recorded by this project under random configurations, in half of them one to three options off, and currents: "
        "410 dives of 48 settings (mission, frame, site) in which no hardware failed; DataFlash logs, read by `care "
        "ingest`.",
    ),
    "px4": Source(
        (),
        "Missions of the PX4 v1.15.4 firmware in its simulation in hardware (SIH), recorded by this project under "
        "random configurations, winds and gusts: 1269 flights of 113 settings (mission, vehicle, site), of each the "
        "reference twice and flights with one to four options off, in 855 of them as failed and with options put back; "
        "ULog files, read by `care ingest`.",
        table="px4.csv",
    ),
    "move_base": Source(
        ("data/move_base/train.tar.xz",),
        "301 missions of the ROS noetic navigation stack (move_base, navfn, dwa_local_planner, costmap_2d) driving a "
        "simulated Husky-sized robot, recorded by this project under random configurations; ROS 1 bags, read by "
        "`care ingest`.",
    ),
    "husky": Source(
        ("data/care/cure_husky_1000.csv",),
        "1000 Husky missions in Gazebo from the CURE artifact (Hossen et al. 2025, MIT license).",
    ),
    "turtlebot3": Source(
        ("data/care/cure_turtlebot3_1000.csv",),
        "1000 TurtleBot 3 missions in Gazebo from the CURE artifact (Hossen et al. 2025, MIT license).",
    ),
    "nav2": Source(
        ("data/nav2/table.tar.xz",),
        "413 missions of Nav2 1.3.13 (ROS 2 Jazzy: DWB, NavFn, the standard tree for one goal) that drove this "
        "project's simulated robot (`samples/nav2_robot`) under random configurations in worlds and to goals that "
        "differ, by `care collect`; MCAP files, read by `care ingest`. Of 40 failed missions of other configurations, "
        "driven again, 29 were advised a change and 26 repaired by it, and 29 by the option named first alone; of 37 "
        "with a failing part that missed a goal, 25 reached all with that part whole, and none of those was advised a "
        "parameter.",
    ),
    "nav2-mppi": Source(
        ("data/nav2-mppi/table.tar.xz",),
        "414 missions of Nav2 1.3.13 (ROS 2 Jazzy: MPPI, NavFn, the standard tree for one goal) that drove this "
        "project's simulated robot (`samples/nav2_robot`) in worlds and to goals that differ, under random "
        "configurations, some with most and some with few options off the reference, by `care collect`; missions in"
        " which a server's answer came too late for the machine are left out; MCAP files, read by `care ingest`.",
    ),
    "nav2-rpp": Source(
        ("data/nav2-rpp/table.tar.xz",),
        "222 missions of Nav2 1.3.13 (ROS 2 Jazzy: Regulated Pure Pursuit, NavFn, the standard tree for one goal) "
        "that drove this project's simulated robot (`samples/nav2_robot`) in worlds and to goals that differ, under"
        " random configurations, some with most and some with few options off the reference, by `care collect`; "
        "missions in which a server's answer came too late for the machine are left out; MCAP files, read by `care "
        "ingest`.",
    ),
    "husky-care": Source(
        ("data/care/care_husky_sim_399.csv",),
        "399 Husky missions in Gazebo from the CaRE artifact (Hossen et al. 2023, MIT license).",
    ),
    "owlat": Source(
        (),
        "300 excavations of `care_samples.arm`, this project's own simulation of a lander's arm and its soil, by its "
        "campaign (seed 1) and `care collect`.",
        simulation="care_samples.arm",
    ),
}


def runs_table(source: Source, schema: Schema, shared: Path, folder: Path) -> Path:
    """The table of runs: the published or kept one, or one made from the logs or by a campaign."""
    if source.table:
        return TABLES / source.table
    if source.simulation:
        start, campaign = folder / schema.name, folder / schema.name / "campaign.yaml"
        for words in ((source.simulation, "--start", start), ("care_tui", "collect", campaign)):
            subprocess.run([sys.executable, "-m", *map(str, words)], check=True)
        return start / "campaign" / "runs.csv"
    paths = [shared / path for path in source.paths]
    if paths[0].suffix == ".csv":
        return paths[0]
    for path in paths:
        with tarfile.open(path) as archive:
            archive.extractall(folder / schema.name, filter="data")
    table = folder / f"{schema.name}.parquet"
    broken = with_failing_hardware(shared / source.hardware) if source.hardware else frozenset()
    logs = [log for log in find_logs([folder / schema.name]) if log.stem not in broken]
    found = ingest(logs, schema, table, progress=lambda _step, _share: None)
    for failure in found.failures:
        print(f"  {failure.path.name}: {failure.reason}")
    write_table(table, found.rows, schema)
    journal_of(table).unlink()
    return table


def with_failing_hardware(table: Path) -> frozenset[str]:
    """Tags of the missions in which hardware failed."""
    with table.open(newline="") as stream:
        return frozenset(row["tag"] for row in csv.DictReader(stream) if row["hardware"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shared", type=Path, default=os.environ.get("CARE_SHARED"), help="folder that holds data/")
    parser.add_argument("--only", action="append", choices=sorted(SOURCES), help="default: all")
    parser.add_argument("--tables", type=Path, help="keep the tables made from logs in this folder")
    parser.add_argument("--resamples", type=int, default=RESAMPLES, help="bootstrap resamples of the graph")
    args = parser.parse_args()
    if args.shared is None:
        parser.error("give --shared DIR or set CARE_SHARED")
    for name in args.only or SOURCES:
        folder = bundled("profiles", name)
        schema = read_schema(folder / "profile.yaml")
        started = time.monotonic()
        print(name, flush=True)
        with tempfile.TemporaryDirectory() as scratch:
            place = args.tables or Path(scratch)
            place.mkdir(parents=True, exist_ok=True)
            frame = read_table(runs_table(SOURCES[name], schema, args.shared, place), schema)
        settings = TrainSettings(resamples=args.resamples, origin=SOURCES[name].origin)
        model = train(frame, schema, settings, lambda step, _share: print(f"  {step}", flush=True))
        write_model(model, folder)
        write_card(folder, schema)
        print(f"{name}: {len(frame)} runs, {time.monotonic() - started:.0f} s", flush=True)


if __name__ == "__main__":
    main()

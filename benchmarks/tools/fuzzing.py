"""Every reader fed with files that were broken at random.

    python -m benchmarks.tools.fuzzing [--seconds 60] [--only NAMES]

A target reads what a good file became after a few changes: bytes set, copied, cut out or in, numbers made extreme,
parts of another good file. Whatever it raises but a `CareError`, and whatever takes longer than 20 s or more than 2 GB,
is a finding. Inputs that a target answered in a way not seen before are kept, and changed further; they and the
findings lie in `.fuzz/TARGET` and are read again by the next run. Each target runs in a process of its own, so that one
that dies is told.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from types import FrameType
from typing import NamedTuple

import numpy as np

from care_core.errors import CareError
from care_core.files import bundled
from care_core.profile.schema import Schema
from care_core.profile.store import load_profile

ROOT = Path(__file__).parents[2]
KEPT = ROOT / ".fuzz"
MOST_BYTES, MOST_MEMORY, LONGEST_S = 1 << 17, 2 << 30, 20
EXTREMES = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 2**63 - 1, 2**63, 2**64 - 1)
WORDS = (b"nan", b"inf", b"-1", b"9" * 400, b"1e999", b"0x", b"null", b"[", b"{", b"&a ", b"*a", b"- ", b"2024-13-45")

Answer = str
"""What a target made of an input, in a few words: inputs of like answers are alike."""


class Target(NamedTuple):
    """`seeds` writes good files into a folder and names them; `read` reads one, raising nothing but CareError."""

    seeds: Callable[[Path], Sequence[Path]]
    read: Callable[[Path], Answer]


def read_log(path: Path) -> Answer:
    """Everything that a log can be asked for, and what its profile makes of it."""
    from care_core.ecosystems.registry import run_model
    from care_core.extract.read import read_run
    from care_core.logs.opening import open_log

    log = open_log(path)
    channels = log.channels()
    tables = log.read({channel.name: ("TimeUS", "Message", "data", "header.stamp", "roll") for channel in channels})
    log.settings()
    words = [log.format.name, str(len(channels)), str(sum(map(len, tables.values())) > 0), str(log.start is not None)]
    words += sorted({damage.what for damage in log.damage}) + sorted(log.facts)
    run = read_run(
        run_model(log), _schema("move_base" if log.format.name.startswith(("ros", "mcap")) else "arducopter")
    )
    return " ".join([*words, *(f"{name} {type(value).__name__}" for name, value in run.objectives.items())])


@cache
def _schema(name: str) -> Schema:
    return load_profile(name).schema


def read_profile(path: Path) -> Answer:
    from care_core.profile.reading import read_schema

    return str(len(read_schema(path).variables))


def read_model_json(path: Path) -> Answer:
    return _model(path, "model.json")


def read_arrays(path: Path) -> Answer:
    return _model(path, "mechanisms.npz")


def _model(path: Path, name: str) -> Answer:
    """The learned half of the bundled profile with one of its files replaced."""
    from care_core.profile.model import read_model

    folder = path.parent / "profile"
    if not folder.exists():
        shutil.copytree(bundled("profiles", "move_base"), folder)
        text = (folder / "model.json").read_text()
        (folder / "model.json").write_text(re.sub(r'"arrays_sha256": "\w*"', '"arrays_sha256": ""', text))
    shutil.copyfile(path, folder / name)
    return str(len(read_model(folder).mechanisms))


def read_report(path: Path) -> Answer:
    from care_core.report.reading import read_report as read

    return str(len(read(path).objectives))


def read_configuration(path: Path) -> Answer:
    from care_core.configs.loading import read_config

    return str(len(read_config(path)) > 0)


def read_settings(path: Path) -> Answer:
    from care_tui.settings import load_settings

    return str(load_settings(path) is not None)


def read_metadata(path: Path) -> Answer:
    from care_core.logs.ros_metadata import parse_metadata

    found = parse_metadata(path.read_text("utf-8", "replace"))
    return f"{bool(found.files)} {len(found.settings()) > 0} {found.duration_s is not None} {len(found.notes()) > 0}"


def read_site(path: Path) -> Answer:
    from care_core.profile.site import load_site

    site = load_site(path)
    return str(site is not None)


def read_campaign(path: Path) -> Answer:
    """A campaign beside what it names."""
    from care_core.collect.campaign import read_campaign as read

    folder = path.parent / "campaign"
    if not folder.exists():
        from tests.campaigns import campaign_in

        folder.mkdir()
        campaign_in(folder)
    shutil.copyfile(path, folder / "campaign.yaml")
    return str(len(read(folder / "campaign.yaml").space.axes))


def read_journal(path: Path) -> Answer:
    from care_core.collect.journal import FILE, Journal

    folder = path.parent / "collected"
    folder.mkdir(exist_ok=True)
    shutil.copyfile(path, folder / FILE)
    with Journal.open(folder, "d") as journal:
        return f"{len(journal.planned) > 0} {len(journal.done) > 0}"


def _flight(folder: Path) -> Sequence[Path]:
    whole = bundled("samples", "arducopter_failed.BIN").read_bytes()
    (folder / "a").write_bytes(whole[: MOST_BYTES // 2])
    return [folder / "a"]


def _text(folder: Path) -> Sequence[Path]:
    from tests.rewritten import write_text

    sample = bundled("samples", "arducopter_failed.BIN")
    return [write_text(folder / "a", sample, only=("MSG", "GPS", "CMD", "ARM", "BAT", "MODE"))]


def _telemetry(folder: Path) -> Sequence[Path]:
    from tests.groundstation import write_tlog

    good = ROOT / "tests" / "data" / "arducopter_good.BIN"
    path = write_tlog(folder / "a", good, np.random.default_rng(0))
    path.write_bytes(path.read_bytes()[-MOST_BYTES:])
    return [path]


def _ulog(folder: Path) -> Sequence[Path]:
    from tests.rewritten import write_ulog

    return [write_ulog(folder / "a")]


def _bag(folder: Path) -> Sequence[Path]:
    from tests.ros_samples import write_bag

    write_bag(folder / "a")
    drive = ROOT / "tests" / "data" / "move_base_good.bag"
    (folder / "b").write_bytes(drive.read_bytes()[:MOST_BYTES])
    return [folder / "a", folder / "b"]


def _db3(folder: Path) -> Sequence[Path]:
    from tests.ros_samples import write_db3

    return [write_db3(folder / "bag")]


def _mcap(folder: Path) -> Sequence[Path]:
    from mcap.writer import CompressionType

    from tests.ros_samples import write_mcap, write_ros1_mcap

    write_mcap(folder / "a")
    write_mcap(folder / "b", compression=CompressionType.ZSTD)
    write_ros1_mcap(folder / "c")
    return [folder / name for name in "abc"]


def _profiles(folder: Path) -> Sequence[Path]:
    return [bundled("profiles", name) / "profile.yaml" for name in ("arducopter", "move_base")]


def _models(folder: Path) -> Sequence[Path]:
    return [bundled("profiles", "move_base") / "model.json"]


def _arrays(folder: Path) -> Sequence[Path]:
    return [bundled("profiles", "move_base") / "mechanisms.npz"]


def _reports(folder: Path) -> Sequence[Path]:
    from care_core.report.document import build_document
    from care_core.report.writers import to_json, to_yaml
    from tests.made import made_diagnosis

    made = build_document(made_diagnosis())
    (folder / "a").write_text(to_yaml(made))
    (folder / "b").write_text(to_json(made))
    return [folder / "a", folder / "b"]


def _configurations(folder: Path) -> Sequence[Path]:
    texts = (
        "# a vehicle\nLAND_SPEED,50\nWPNAV_SPEED 500\n",
        "# Onboard parameters\n#\n1\t1\tLAND_SPEED\t50\t4\n1\t1\tATC_RAT_RLL_P\t0.135\t9\n",
        "DWAPlannerROS:\n  max_vel_x: 0.5\n  list: [1, 2.5, true]\nb: !!python/object/new:x {dictitems: {a: 1}}\n",
        "/**:\n  ros__parameters:\n    a.b: 1\n    c: {d: [x, 'y', 0x1F]}\n",
    )
    for number, text in enumerate(texts):
        (folder / f"{number}.yaml").write_text(text)
    return sorted(folder.glob("*.yaml"))


def _settings(folder: Path) -> Sequence[Path]:
    (folder / "a").write_text("theme: nord\ncolor: '256'\nfps: 30\nplaces: [~/logs]\nkeys: {app.quit: x}\n")
    return [folder / "a"]


def _metadata(folder: Path) -> Sequence[Path]:
    (folder / "a").write_text(
        "rosbag2_bagfile_information:\n  version: 9\n  duration: {nanoseconds: 5000000000}\n  message_count: 12\n"
        "  relative_file_paths: [a.db3]\n  ros_distro: humble\n  custom_data: {/a.b: '1', note: x,"
        " p: 'a: {ros__parameters: {b: 1}}'}\n"
    )
    return [folder / "a"]


def _site(folder: Path) -> Sequence[Path]:
    (folder / "a").write_text(
        "schema_version: 1\nlimits:\n  arducopter:\n    mission_time: {value: 150, mission: {waypoints: 5}}\n"
        "    energy: {ratio: 1.3}\n"
    )
    return [folder / "a"]


def _campaign(folder: Path) -> Sequence[Path]:
    from tests.campaigns import campaign_in

    return [campaign_in(folder, slots=2, seed=3)]


def _journal(folder: Path) -> Sequence[Path]:
    from care_core.collect.journal import Done, Journal
    from care_core.collect.sampling import Planned

    with Journal.open(folder, "d") as journal:
        runs = [Planned(number, {"max_speed": 0.5}, 0) for number in range(3)]
        journal.plan(runs)
        journal.add(Done(1, 1, 2.5, ("a.bag",), ({"max_speed": 0.5},)))
        journal.add(Done(2, 2, 0.5, failure="it crashed"))
    return [folder / "journal.jsonl"]


TARGETS: dict[str, Target] = {
    "dataflash": Target(_flight, read_log),
    "dataflash text": Target(_text, read_log),
    "telemetry": Target(_telemetry, read_log),
    "ulog": Target(_ulog, read_log),
    "ros1 bag": Target(_bag, read_log),
    "ros2 db3": Target(_db3, read_log),
    "mcap": Target(_mcap, read_log),
    "recording metadata": Target(_metadata, read_metadata),
    "profile": Target(_profiles, read_profile),
    "model": Target(_models, read_model_json),
    "arrays": Target(_arrays, read_arrays),
    "report": Target(_reports, read_report),
    "configuration": Target(_configurations, read_configuration),
    "settings": Target(_settings, read_settings),
    "site": Target(_site, read_site),
    "campaign": Target(_campaign, read_campaign),
    "journal": Target(_journal, read_journal),
}


def changed(data: bytes, others: Sequence[bytes], rng: np.random.Generator) -> bytes:
    """The data with one to five changes."""
    raw = bytearray(data)
    for _ in range(int(rng.integers(1, 6))):
        at = int(rng.integers(len(raw) + 1))
        size = min(int(rng.geometric(0.02)), 4096)
        part = raw[at : at + size]
        kind = int(rng.integers(8))
        if kind == 0 and at < len(raw):
            raw[at] ^= 1 << int(rng.integers(8))
        elif kind == 1:
            raw[at : at + size] = rng.bytes(len(part))
        elif kind == 2:
            del raw[at : at + size]
        elif kind == 3:
            raw[at:at] = part * int(rng.integers(1, 4))
        elif kind == 4:
            width = int(rng.choice([1, 2, 4, 8]))
            value = int(EXTREMES[int(rng.integers(len(EXTREMES)))]) % (1 << 8 * width)
            raw[at : at + width] = value.to_bytes(width, "little" if rng.random() < 0.8 else "big")
        elif kind == 5:
            number = WORDS[int(rng.integers(len(WORDS)))]
            raw[at : at + len(number)] = number
        elif kind == 6:
            other = others[int(rng.integers(len(others)))]
            start = int(rng.integers(len(other) + 1))
            raw[at : at + size] = other[start : start + size]
        elif rng.random() < 0.2:
            del raw[at:]
    return bytes(raw[:MOST_BYTES])


def fuzz(name: str, seconds: float, seed: int, kept: Path) -> tuple[int, int]:
    """Executions and findings of a target; `kept` is the folder of its corpus and findings."""
    target, rng = TARGETS[name], np.random.default_rng(seed)
    kept.mkdir(parents=True, exist_ok=True)
    executions = findings = 0
    with tempfile.TemporaryDirectory() as folder:
        seeds = [path.read_bytes() for path in target.seeds(Path(folder))]
        corpus = seeds + [path.read_bytes() for path in sorted(kept.glob("corpus-*"))]
        seen: set[str] = set()
        until = time.monotonic() + seconds
        current = kept / "current"
        while time.monotonic() < until:
            fresh = corpus[executions] if executions < len(corpus) else None
            data = changed(corpus[int(rng.integers(len(corpus)))], seeds, rng) if fresh is None else fresh
            current.write_bytes(data)
            answer, problem = run_once(target, current)
            executions += 1
            if problem:
                findings += answer not in seen
                _keep(kept, "finding", data)
                print(f"{name}: {problem}", file=sys.stderr)
            elif answer not in seen and fresh is None:
                corpus.append(data)
                _keep(kept, "corpus", data)
            seen.add(answer)
        current.unlink(missing_ok=True)
    return executions, findings


def run_once(target: Target, path: Path) -> tuple[Answer, str]:
    """The answer, and where it is a finding the traceback."""

    def too_long(_number: int, _frame: FrameType | None) -> None:
        raise TimeoutError(f"more than {LONGEST_S} s")

    signal.signal(signal.SIGALRM, too_long)
    signal.alarm(LONGEST_S)
    try:
        return _shape(target.read(path)), ""
    except CareError as err:
        return _shape(f"refused: {err.message}"), ""
    except (Exception, TimeoutError) as err:
        return f"{type(err).__name__} {traceback.extract_tb(err.__traceback__)[-1].lineno}", traceback.format_exc()
    finally:
        signal.alarm(0)


def _shape(answer: Answer) -> Answer:
    """Without the numbers and names in it."""
    return re.sub(r"'[^']*'|\d+", "_", answer)[:300]


def _keep(folder: Path, kind: str, data: bytes) -> None:
    (folder / f"{kind}-{hashlib.sha256(data).hexdigest()[:16]}").write_bytes(data)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--seconds", type=float, default=60, help="of each target")
    parser.add_argument("--only", default="", help="names of targets, with commas")
    parser.add_argument("--seed", type=int, default=int(time.time()))
    parser.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    names = [name for name in TARGETS if not given.only or name in given.only.split(",")]
    if given.inside:
        resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
        (name,) = names
        print(*fuzz(name, given.seconds, given.seed, KEPT / name.replace(" ", "_")))
        return
    print(f"seed {given.seed}, {given.seconds:.0f} s each\n{'target':<20}{'executions':>12}{'findings':>10}")
    total = 0
    for name in names:
        command = [sys.executable, "-m", "benchmarks.tools.fuzzing", "--inside", "--only", name]
        command += ["--seconds", str(given.seconds), "--seed", str(given.seed)]
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
        ran = subprocess.run(command, stdout=subprocess.PIPE, text=True, cwd=ROOT, env=environment, check=False)
        done = ran.stdout.split()
        # A process that died leaves the input that it died of.
        executions, findings = map(int, done[-2:]) if ran.returncode == 0 else (0, 1)
        total += findings
        died = "" if ran.returncode == 0 else f"  died with {ran.returncode}: .fuzz/{name.replace(' ', '_')}/current"
        print(f"{name:<20}{executions:>12}{findings:>10}{died}", flush=True)
    sys.exit(min(total, 1))


if __name__ == "__main__":
    main()

"""Are faults really repaired? The fixes of failed missions are flown, on whatever a campaign's command starts.

    python -m benchmarks.flown CAMPAIGN.yaml --profile DIR -o DIR [--table RUNS.csv] [--other NAME]... [--faults 30]

A fault is a configuration with some options off their reference, under conditions that no run of the campaign met,
which misses an objective twice. Everything else is the command line's: `care triage` reads the log, `care apply` puts
what is advised into the parameter file, the campaign's command runs it, `care verify` reads that log. It is run under
the conditions of the fault, under others, and once more under the first, to tell chance. `--other` is a profile trained
elsewhere, asked about the same logs. Peers put one option back to its reference, run once under each of the conditions:
the one that is furthest from it, and the one that a plain classifier of the table chooses.

Whether a mission met everything is what `truth.json` beside the folder of its logs says (`{"met": true}`), where the
command leaves one, since a simulator knows better than a log; else what the profile reads in the log.
"""

from __future__ import annotations

import argparse
import json
import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from care_core.collect.campaign import Campaign, parameter_file_names, read_campaign
from care_core.collect.mission import command_words, write_parameters
from care_core.collect.sampling import Planned, points, run_seed
from care_core.errors import ExitCode
from care_core.learn.baselines import PlainClassifier, largest_deviation
from care_core.learn.skill import all_met
from care_core.learn.table import read_table
from care_core.logs.finding import logs_below

OFF = 0.15
"""Share of the options of a field configuration that are off their reference."""
ANOTHER_DAY = 50_000
"""What is added to a seed for other conditions."""
MOST_TRIED = 20
"""Configurations to try for each fault that is wanted."""
Z95 = 1.959964

Config = Mapping[str, float]
Report = dict[str, Any]


@dataclass(frozen=True)
class Mission:
    """One that was run: its log, and whether it met every objective."""

    log: Path
    met: bool


class Field:
    """Runs missions and asks the program about them, in folders of its own."""

    def __init__(self, campaign: Campaign, profile: Path, folder: Path) -> None:
        self.campaign, self.profile, self.folder = campaign, profile, folder
        self._slots: queue.SimpleQueue[int] = queue.SimpleQueue()
        for slot in range(campaign.slots):
            self._slots.put(slot)

    def run(self, name: str, config: Config, seed: int, parameters: Path | None = None) -> Mission:
        """Run a mission, with a parameter file that is there already or one of the configuration.

        One that was over when an earlier call was ended is not run again.

        Raises:
            RuntimeError: the command failed in each of its tries.
        """
        place = self.folder / name
        for attempt in range(1 + self.campaign.retries):
            folder = place / str(attempt)
            logs, over = folder / "logs", folder / "over"
            if over.exists():
                return Mission(logs_below(logs)[0], self.met(folder, logs_below(logs)[0]))
            logs.mkdir(parents=True, exist_ok=True)
            params = parameters or write_parameters(self.campaign, config, folder)[0]
            slot = self._slots.get()
            try:
                words = command_words(self.campaign, Planned(1, config, seed), params.absolute(), logs.absolute(), slot)
                ended = self._command(words, folder)
            finally:
                self._slots.put(slot)
            found = logs_below(logs)
            if ended and found:
                over.touch()
                return Mission(found[0], self.met(folder, found[0]))
        raise RuntimeError(f"{place}: the command failed")

    def _command(self, words: Sequence[str], folder: Path) -> bool:
        with (folder / "command.log").open("wb") as output:
            try:
                done = subprocess.run(
                    words,
                    check=False,
                    stdout=output,
                    stderr=subprocess.STDOUT,
                    cwd=self.campaign.folder,
                    timeout=self.campaign.time_limit_s,
                )
            except subprocess.TimeoutExpired:
                return False
        return done.returncode == 0

    def met(self, folder: Path, log: Path) -> bool:
        """Whether a mission met every objective, from its folder and log."""
        truth = folder / "truth.json"
        if truth.exists():
            return bool(json.loads(truth.read_text(encoding="utf-8"))["met"])
        return care("triage", log, "--profile", self.profile, "--json", "--no-history")[0] == ExitCode.OK


def care(*words: object) -> tuple[int, str]:
    """The program's exit code and output."""
    command = [sys.executable, "-m", "care_tui", *map(str, words)]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    return done.returncode, done.stdout


def days(seed: int) -> tuple[int, int, int]:
    """The seeds under which a repair is run: those of the fault, others, those of the fault again."""
    return seed, seed + ANOTHER_DAY, seed


def advised(field: Field, profile: str, fault: Mission, name: str, config: Config, seed: int) -> Report:
    """What a profile makes of a failed mission, and what becomes of its advice."""
    place = field.folder / name
    place.mkdir(parents=True, exist_ok=True)
    report, fixed = place / "report.json", place / "fixed" / field_file(field.campaign)
    code, _ = care("triage", fault.log, "--profile", profile, "--json", "--no-history", "--out", report)
    told = json.loads(report.read_text(encoding="utf-8")) if report.exists() else {}
    found: Report = {"code": code, "fix": told.get("fix"), "abstained": told.get("abstained")}
    if not told.get("fix"):
        return found
    fixed.parent.mkdir(exist_ok=True)
    params = fault.log.parents[1] / field_file(field.campaign)
    applied, said = care("apply", report, params, "--profile", profile, "-o", fixed)
    found["applied"] = applied
    if applied != ExitCode.OK:
        return {**found, "said": said}
    changes = {change["option"]: change["to"] for change in told["fix"]["changes"]}
    repaired = {**config, **changes}
    missions = [field.run(f"{name}/{k}", repaired, day, fixed) for k, day in enumerate(days(seed))]
    found["met"] = [mission.met for mission in missions]
    found["verdicts"] = [verdict(report, profile, mission.log) for mission in missions]
    return found


def verdict(report: Path, profile: str, log: Path) -> str:
    """What `care verify` makes of the mission after the repair."""
    _, said = care("verify", report, log, "--profile", profile, "--json", "--no-history")
    return str(json.loads(said)["verdict"])


def field_file(campaign: Campaign) -> str:
    """The name of the one parameter file."""
    (name,) = parameter_file_names(campaign.parameters)
    return name


@dataclass(frozen=True)
class Asked:
    """Who is asked about each fault."""

    profiles: Mapping[str, str]
    """By what they are called, folders or names."""
    peers: Mapping[str, Callable[[Config], str]]
    """The option that each puts back to its reference."""


def one_fault(field: Field, asked: Asked, number: int, config: Config, seed: int) -> Report:
    """Run a configuration; where it fails twice, everything that is to be known of its repair."""
    name = f"{number:04d}"
    found: Report = {"number": number, "seed": seed, "off": off_reference(field.campaign, config)}
    first = field.run(f"{name}/fault/0", config, seed)
    if first.met:
        return {**found, "fault": False}
    if field.run(f"{name}/fault/1", config, seed).met:
        return {**found, "fault": False, "chance": True}
    found["fault"] = True
    found["profiles"] = {
        word: advised(field, profile, first, f"{name}/{word}", config, seed) for word, profile in asked.profiles.items()
    }
    found["peers"] = {}
    reference, flown = field.campaign.space.reference, dict[str, list[bool]]()
    for word, choose in asked.peers.items():
        option = choose(config)
        if option not in flown:
            reset = {**config, option: reference[option]}
            place = f"{name}/reset-{option}"
            flown[option] = [field.run(f"{place}/{k}", reset, day).met for k, day in enumerate(days(seed)[:2])]
        found["peers"][word] = {"option": option, "met": flown[option]}
    return found


def off_reference(campaign: Campaign, config: Config) -> dict[str, float]:
    """The options that are off their reference, with their values."""
    reference = campaign.space.reference
    return {axis.name: config[axis.name] for axis in campaign.space.axes if config[axis.name] != reference[axis.name]}


def peers(campaign: Campaign, table: Path) -> dict[str, Callable[[Config], str]]:
    """The rules that put one option back, by what they are called."""
    schema, reference = campaign.schema, campaign.space.reference
    frame = read_table(table, schema)
    known = all_met(frame, schema)
    names = [axis.name for axis in campaign.space.axes]
    plain = PlainClassifier(frame[np.isfinite(known)], known[np.isfinite(known)] == 1.0, names)

    def furthest(config: Config) -> str:
        return largest_deviation(config, reference, schema, list(off_reference(campaign, config)))[0]

    def most_likely(config: Config) -> str:
        return plain.rank(config, reference, list(off_reference(campaign, config)))[0]

    return {
        "furthest option to its reference": furthest,
        "plain classifier's option to its reference": most_likely,
    }


def measure(field: Field, asked: Asked, wanted: int, seed: int) -> list[Report]:
    """Try configurations until so many faults are found; what was found before is not run again."""
    journal = field.folder / "faults.jsonl"
    done: list[Report] = [json.loads(line) for line in journal.read_text().splitlines()] if journal.exists() else []
    seen = {report["number"] for report in done}
    configs = points(field.campaign.space, "uniform", MOST_TRIED * wanted, 1 - OFF, seed)
    guard = threading.Lock()

    def work(number: int) -> None:
        with guard:
            if number in seen or sum(report["fault"] for report in done) >= wanted:
                return
        try:
            found = one_fault(field, asked, number, configs[number], run_seed(seed, number))
        except RuntimeError as err:
            found = {"number": number, "fault": False, "error": str(err)}
        with guard, journal.open("a", encoding="utf-8") as stream:
            done.append(found)
            stream.write(json.dumps(found) + "\n")

    with ThreadPoolExecutor(field.campaign.slots) as workers:
        list(workers.map(work, range(len(configs))))
    return sorted(done, key=lambda report: report["number"])


def wilson(hits: int, count: int) -> tuple[float, float]:
    """The interval of a share, 95 %."""
    if not count:
        return 0.0, 1.0
    share, z2 = hits / count, Z95**2 / count
    middle, half = share + z2 / 2, Z95 * np.sqrt(share * (1 - share) / count + z2 / 4 / count)
    return float((middle - half) / (1 + z2)), float((middle + half) / (1 + z2))


def share(hits: int, count: int) -> str:
    low, high = wilson(hits, count)
    return f"{hits} of {count} ({low:.0%} to {high:.0%})"


def show(done: Sequence[Report]) -> None:
    """Print the shares."""
    faults = [report for report in done if report["fault"]]
    n = len(faults)
    print(f"{len(done)} configurations run, {n} failed twice, {sum('chance' in r for r in done)} failed once of two, "
          f"{sum('error' in r for r in done)} gave no mission")  # fmt: skip
    for word in faults[0]["profiles"] if faults else ():
        show_profile(word, [report["profiles"][word] for report in faults])
    for word in faults[0]["peers"] if faults else ():
        answers = [report["peers"][word] for report in faults]
        print(f"{word}: repaired {share(first(answers, 0), n)}, another day {share(first(answers, 1), n)}")


def show_profile(word: str, answers: Sequence[Report]) -> None:
    """Print what became of a profile's answers about each fault."""
    n, flown = len(answers), [answer for answer in answers if "met" in answer]
    print(f"{word}: flagged {sum(a['code'] == ExitCode.FAULT for a in answers)} of {n}, advised {len(flown)}")
    both = sum(answer["met"][0] and answer["met"][2] for answer in flown)
    print(f"  of all faults repaired          {share(first(flown, 0), n)}, twice {share(both, n)}")
    print(f"  of all faults, another day      {share(first(flown, 1), n)}")
    print(f"  of what was advised, repaired   {share(first(flown, 0), len(flown))}")
    if flown:
        promised = np.mean([answer["fix"]["p_fixed"] for answer in flown])
        changed = np.median([len(answer["fix"]["changes"]) for answer in flown])
        print(f"  promised {promised:.2f} in the mean; {changed:g} options changed in the middle")
    checked = [pair for answer in flown for pair in zip(answer["verdicts"], answer["met"], strict=True)]
    right = sum(verdict.startswith("fixed") == met for verdict, met in checked)
    print(f"  care verify says what happened in {right} of {len(checked)} missions")


def first(answers: Sequence[Report], which: int) -> int:
    """How many repairs met everything in one of their missions, counted from 0."""
    return sum(answer["met"][which] for answer in answers)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("campaign", type=Path)
    parser.add_argument("--profile", type=Path, required=True, help="trained on the campaign's table")
    parser.add_argument("--table", type=Path, help="the campaign's runs.csv: for the peers, without it there are none")
    parser.add_argument("--other", action="append", default=[], help="another profile, a name or a folder")
    parser.add_argument("--faults", type=int, default=30)
    parser.add_argument("--seed", type=int, default=9000, help="not the campaign's")
    parser.add_argument("-o", "--out", type=Path, required=True, help="folder of the missions; goes on where it was")
    args = parser.parse_args()
    campaign = read_campaign(args.campaign)
    args.out.mkdir(parents=True, exist_ok=True)
    profiles = {"trained on the campaign": str(args.profile), **{name: name for name in args.other}}
    field = Field(campaign, args.profile, args.out)
    others = peers(campaign, args.table) if args.table else {}
    show(measure(field, Asked(profiles, others), args.faults, args.seed))


if __name__ == "__main__":
    main()

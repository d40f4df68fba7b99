"""Are faults really repaired? The fixes of failed missions are flown, on whatever a campaign's command starts.

    python -m benchmarks.flown CAMPAIGN.yaml --profile DIR -o DIR [--table RUNS.csv] [--other NAME]... [--faults 30]
                               [--resets alone|pairs]

A fault is a configuration with some options off their reference, under conditions that no run of the campaign met,
which misses an objective twice. Everything else is the command line's: `care triage` reads the log, `care apply` puts
what is advised into the parameter file, the campaign's command runs it, `care verify` reads that log. It is run under
the conditions of the fault, under others, and once more under the first, to tell chance. `--other` is a profile trained
elsewhere, asked about the same logs. Peers put one option back to its reference, run once under each of the conditions:
the one that is furthest from it, and the one that a plain classifier of the table chooses.

`--resets alone` finds the true causes: under the conditions of the fault it runs everything at its reference, and where
that meets everything, each option that is off it back alone. `--resets pairs` goes on, where no option alone does, with
all pairs of them. Then the option that is named first can be held against those that repair.

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
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from benchmarks.peers import PlainClassifier, largest_deviation
from care_core.collect.campaign import Campaign, parameter_file_names, read_campaign
from care_core.collect.mission import command_words, write_parameters
from care_core.collect.sampling import Planned, points, run_seed
from care_core.errors import ExitCode
from care_core.learn.skill import all_met
from care_core.learn.table import read_table
from care_core.logs.finding import logs_below
from care_core.records import Record

OFF = 0.15
"""Share of the options of a field configuration that are off their reference."""
ANOTHER_DAY = 50_000
"""What is added to a seed for other conditions."""
MOST_TRIED = 20
"""Configurations to try for each fault that is wanted."""
Z95 = 1.959964

Config = Mapping[str, float]
Report = dict[str, Any]
T = TypeVar("T")
Peer = Callable[[Config], str]
"""Chooses the option of a configuration that it puts back to its reference."""


class Mission(Record):
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
    causes = [cause["option"] for broken in told.get("faults", ())[:1] for cause in broken["causes"]]
    found: Report = {"code": code, "fix": told.get("fix"), "abstained": told.get("abstained"), "causes": causes}
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


def one_fault(field: Field, profiles: Mapping[str, str], number: int, config: Config, seed: int) -> Report:
    """Run a configuration; where it fails twice, what each profile (by what it is called, a folder or name) advises."""
    name = f"{number:04d}"
    found: Report = {"number": number, "seed": seed, "off": off_reference(field.campaign, config)}
    first = field.run(f"{name}/fault/0", config, seed)
    if first.met:
        return {**found, "fault": False}
    if field.run(f"{name}/fault/1", config, seed).met:
        return {**found, "fault": False, "chance": True}
    found["fault"] = True
    found["profiles"] = {
        word: advised(field, profile, first, f"{name}/{word}", config, seed) for word, profile in profiles.items()
    }
    return found


def off_reference(campaign: Campaign, config: Config) -> dict[str, float]:
    """The options that are off their reference, with their values."""
    reference = campaign.space.reference
    return {axis.name: config[axis.name] for axis in campaign.space.axes if config[axis.name] != reference[axis.name]}


def peers(campaign: Campaign, table: Path) -> dict[str, Peer]:
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


class Done:
    """What is known of each configuration, by its number, in memory and in a file: the last line of a number counts."""

    def __init__(self, path: Path) -> None:
        lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
        self._path, self._guard = path, threading.Lock()
        self._known: dict[int, Report] = {report["number"]: report for report in map(json.loads, lines)}

    def __contains__(self, number: int) -> bool:
        return number in self._known

    def add(self, report: Report) -> None:
        with self._guard, self._path.open("a", encoding="utf-8") as stream:
            self._known[report["number"]] = report
            stream.write(json.dumps(report) + "\n")

    def all(self) -> list[Report]:
        with self._guard:
            return sorted(self._known.values(), key=lambda report: report["number"])

    def faults(self) -> list[Report]:
        return [report for report in self.all() if report["fault"]]


def measure(field: Field, profiles: Mapping[str, str], done: Done, wanted: int, seed: int) -> None:
    """Try configurations until so many faults are found; what was found before is not run again."""
    configs = points(field.campaign.space, "uniform", MOST_TRIED * wanted, 1 - OFF, seed, alike=True)

    def work(number: int) -> None:
        if number in done or len(done.faults()) >= wanted:
            return
        try:
            done.add(one_fault(field, profiles, number, configs[number], run_seed(seed, number)))
        except RuntimeError as err:
            done.add({"number": number, "fault": False, "error": str(err)})

    at_once(field, work, range(len(configs)))


def at_once(field: Field, work: Callable[[T], None], parts: Iterable[T]) -> None:
    """Do the parts of a work, as many at a time as the campaign has slots."""
    with ThreadPoolExecutor(field.campaign.slots) as workers:
        list(workers.map(work, parts))


def for_each(field: Field, done: Done, work: Callable[[Report], Report]) -> None:
    """Add to each fault what a work finds; one with a mission that fails to run is left for another call."""

    def add(fault: Report) -> None:
        try:
            done.add({**fault, **work(fault)})
        except RuntimeError as err:
            print(err, file=sys.stderr)

    at_once(field, add, done.faults())


def compare(field: Field, others: Mapping[str, Peer], fault: Report) -> Report:
    """What becomes of a fault where peers put their option back, under its conditions and under others."""
    if "peers" in fault:
        return {}
    config = {**field.campaign.space.reference, **fault["off"]}
    chosen = {word: choose(config) for word, choose in others.items()}
    return {
        "peers": {
            word: {"option": option, "met": [put_back(field, fault, (option,), day) for day in (0, 1)]}
            for word, option in chosen.items()
        }
    }


def reset(field: Field, fault: Report, *, in_pairs: bool) -> Report:
    """What becomes of a fault with all of its options back; where that repairs it with each alone, and in pairs where
    none does. Where the reference fails like this as well no option is to blame."""
    off = fault["off"]
    found = fault.get("resets") or {"all": put_back(field, fault, tuple(off))}
    if found["all"] and "alone" not in found:
        found["alone"] = {option: put_back(field, fault, (option,)) for option in off}
    if in_pairs and found["all"] and not any(found["alone"].values()) and "pairs" not in found:
        found["pairs"] = [pair for pair in combinations(off, 2) if put_back(field, fault, pair)]
    return {"resets": found}


def put_back(field: Field, fault: Report, options: Sequence[str], day: int = 0) -> bool:
    """Whether a mission meets everything with these options of a fault at their reference, the others as they were.

    What was run already, because a profile advised it, is not run again, and what the campaign's limits forbid never.
    """
    reference = field.campaign.space.reference
    for answer in fault["profiles"].values():
        changes = {change["option"]: change["to"] for change in answer["fix"]["changes"]} if "met" in answer else {}
        if changes == {option: reference[option] for option in options}:
            return bool(answer["met"][day])
    off = {name: value for name, value in fault["off"].items() if name not in options}
    config = {**reference, **off}
    name = f"{fault['number']:04d}/reset-{'+'.join(options)}" if off else f"{fault['number']:04d}/reference"
    allowed = field.campaign.space.allows(config)
    return allowed and field.run(f"{name}/{day}", config, days(fault["seed"])[day]).met


def true_causes(fault: Report) -> set[str]:
    """The options that repair a fault alone; where there is none, those of pairs that do."""
    resets = fault["resets"]
    alone = {option for option, met in resets.get("alone", {}).items() if met}
    return alone or {option for pair in resets.get("pairs", ()) for option in pair}


def wilson(hits: int, count: int) -> tuple[float, float]:
    """The interval of a share, 95%."""
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
    compared = [report["peers"] for report in faults if "peers" in report]
    for word in compared[0] if compared else ():
        answers, n = [peers[word] for peers in compared], len(compared)
        print(f"{word}: repaired {share(first(answers, 0), n)}, another day {share(first(answers, 1), n)}")
    show_causes([report for report in faults if "resets" in report])


def show_causes(faults: Sequence[Report]) -> None:
    """Print what the resets tell of the causes, and who names one of them first."""
    alone = sum(any(fault["resets"].get("alone", {}).values()) for fault in faults)
    known = [fault for fault in faults if true_causes(fault)]
    print(f"{len(faults)} with every reset run: the reference meets everything in "
          f"{sum(fault['resets']['all'] for fault in faults)}, an option alone in {alone}, "
          f"only pairs in {len(known) - alone}")  # fmt: skip
    for word in known[0]["profiles"] if known else ():
        named = [fault["profiles"][word]["causes"][:1] for fault in known]
        right = sum(set(causes) <= true_causes(fault) for causes, fault in zip(named, known, strict=True) if causes)
        print(f"{word}: a true cause named first {share(right, len(known))}, "
              f"of those named {share(right, sum(map(len, named)))}")  # fmt: skip
    compared = [fault for fault in known if "peers" in fault]
    for word in compared[0]["peers"] if compared else ():
        right = sum(fault["peers"][word]["option"] in true_causes(fault) for fault in compared)
        print(f"{word}: a true cause {share(right, len(compared))}")


def show_profile(word: str, answers: Sequence[Report]) -> None:
    """Print what became of a profile's answers about each fault."""
    n, flown = len(answers), [answer for answer in answers if "met" in answer]
    print(f"{word}: flagged {sum(a['code'] == ExitCode.FAULT for a in answers)} of {n}, advised {len(flown)}")
    both = sum(answer["met"][0] and answer["met"][2] for answer in flown)
    print(f"  of all faults repaired          {share(first(flown, 0), n)}, twice {share(both, n)}")
    print(f"  of all faults, another day      {share(first(flown, 1), n)}")
    print(f"  of what was advised, repaired   {share(first(flown, 0), len(flown))}")
    if flown:
        promised = np.mean([odds for answer in flown if (odds := answer["fix"]["p_fixed"]) is not None])
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
    parser.add_argument("--resets", choices=("alone", "pairs"), help="run each fault with its options put back too")
    parser.add_argument("--seed", type=int, default=9000, help="not the campaign's")
    parser.add_argument("-o", "--out", type=Path, required=True, help="folder of the missions; goes on where it was")
    args = parser.parse_args()
    campaign = read_campaign(args.campaign)
    args.out.mkdir(parents=True, exist_ok=True)
    profiles = {"trained on the campaign": str(args.profile), **{name: name for name in args.other}}
    others = peers(campaign, args.table) if args.table else {}
    field, done = Field(campaign, args.profile, args.out), Done(args.out / "faults.jsonl")
    measure(field, profiles, done, args.faults, args.seed)
    if args.resets:
        for_each(field, done, partial(reset, field, in_pairs=False))
    for_each(field, done, partial(compare, field, others))
    if args.resets == "pairs":
        for_each(field, done, partial(reset, field, in_pairs=True))
    show(done.all())


if __name__ == "__main__":
    main()

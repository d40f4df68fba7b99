"""Writes `care_core/metadata/screening.tsv` from flights with one parameter wrong at a time.

usage: python -m benchmarks.tools.screening FOLDER VEHICLE REFERENCES

FOLDER: rows.jsonl (tag, name, value, ok) and logs/TAG.*, of what was lost at least
REFERENCES: JSON, each parameter's reference

How a flight failed is what `care` itself reads out of its log, by the same words that a run is held against later. A
flight of which it sees nothing wrong counts as one that was not lost.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from care_core.application.case import Request, open_case
from care_core.diagnose.judging import query_of
from care_core.diagnose.outside.signs import Signs, signs_of
from care_core.metadata.screening import TABLE

HEAD = """\
# Flights of the firmware's own simulator with one parameter wrong at a time and all others at their reference, three
# short missions: Copter 4.5.4 in a light wind (C), Rover 4.5.4 (R), QuadPlane 4.5.4 (P; what was lost in the air was
# lost twice); one short mission: PX4 1.15.4, a quadcopter (X). Documented values and ends of ranges. `first`: the signs
# that came first (words of causal_map.py), empty where the mission met every limit; `others`: those that followed;
# `refusals`: what kept it from arming, without its numbers. Written by benchmarks/tools/screening.py.
name	vehicle	reference	value	first	others	refusals
"""


def signs(log: Path) -> Signs:
    """How `care` sees that a flight failed; no signs where it sees nothing wrong."""
    case = open_case(Request(log), lambda _step, _share: None)
    run = case.diagnosis.run
    broken = [one for one in case.diagnosis.objectives if one.status == "fault"]
    if not broken and not any(one.severity == "critical" for one in case.diagnosis.health.findings):
        return Signs(frozenset(), frozenset())
    if case.reading is None or not case.diagnosis.faults:
        return signs_of(run, broken, case.diagnosis.health)
    query = query_of(case.reading.judged, case.reading.profile, ())
    return signs_of(run, broken, case.diagnosis.health, case.reading.profile.schema, query)


def row(flight: dict[str, Any], reference: float, vehicle: str, log: Path | None) -> str:
    """One line of the table."""
    seen = Signs(frozenset(), frozenset()) if flight["ok"] or log is None else signs(log)
    cells = (sorted(seen.first), sorted(seen.every - seen.first))
    told = [" ".join(names) for names in cells]
    numbers = [f"{number:.7g}" for number in (reference, flight["value"])]
    return "\t".join((flight["name"], vehicle, *numbers, *told, "; ".join(sorted(seen.refusals))))


def main(folder: Path, vehicle: str, references: Path) -> None:
    flights = [json.loads(line) for line in (folder / "rows.jsonl").read_text().splitlines()]
    known = {name: one["reference"] for name, one in json.loads(references.read_text()).items()}
    logs = {one.stem: one for one in (folder / "logs").iterdir()}
    lines = [
        row(flight, known[flight["name"]], vehicle, logs.get(flight["tag"]))
        for flight in sorted(flights, key=lambda one: (one["name"], one["value"]))
        if flight["ok"] or flight["tag"] in logs
    ]
    others = (line for line in TABLE.read_text().splitlines() if not line.startswith(("#", "name\t")))
    kept = [line for line in others if line.split("\t")[1] != vehicle]
    TABLE.write_text(HEAD + "\n".join(sorted([*kept, *lines])) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3]))

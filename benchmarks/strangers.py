"""What `care` says of every log in a folder of strangers' logs, beside an expert and beside other tools.

    python -m benchmarks.strangers [--shared DIR] [--words] [--mcp PYTHON] [--flightdx COMMAND]

The folder holds `logs/` with `logs/EXPECTED.md`, a table of file, what it is, what an expert says, kind, onset, what
must not be said, and how sure that is. Prints a row a log: the expert's kind, how a profile fits, how a triage ends and
its first finding, the advice if there is one; with `--words` the expert's sentence too. `--mcp` is a Python that has
ardupilot-mcp, `--flightdx` the command of flightdx: their first finding stands in the same row. Last the counts, for
each tool: changes where the expert wants none, failures called fine, failures without any finding, criticals on what
the expert calls healthy.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import care_core
from care_core.diagnose.verdict import verdict_of
from care_core.errors import CareError, ExitCode
from care_core.records import Record

SECONDS = 120
_SETTING = ("tuning", "prearm/configuration")
"""Kinds for which the expert may want a parameter changed."""
_DATAFLASH = ("dataflash_bin", "mavlink_tlog")
_VERDICTS = {ExitCode.OK: "OK", ExitCode.FAULT: "FAULT", ExitCode.NOT_EVALUATED: "not evaluated"}
_ASK_MCP = """
import json, sys
from ardupilot_mcp.server import analyze_log
found = analyze_log(sys.argv[1]).findings
print(json.dumps([{"severity": str(one.severity.value), "title": one.title} for one in found]))
"""


class Expected(Record):
    """What an expert says of a log."""

    file: str
    what: str
    says: str
    kind: str
    sure: str

    @property
    def is_failure(self) -> bool:
        return not self.kind.startswith(("healthy", "too-short")) and self.sure != "low"

    @property
    def is_healthy(self) -> bool:
        return self.kind.startswith("healthy")

    @property
    def wants_no_change(self) -> bool:
        return not any(kind in self.kind for kind in _SETTING)


class Answer(Record):
    """What a tool says: fit of its profile, how it ends, its first finding, whether any finding is critical."""

    fit: str = ""
    verdict: str = ""
    first: str = ""
    is_critical: bool = False
    advice: str = ""
    is_silent: bool = False


def expected(path: Path) -> Iterator[Expected]:
    """The rows of the expert's table."""
    for line in path.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip().strip("`") for cell in line.strip().strip("|").split("|")]
        if len(cells) >= 7 and cells[0] not in ("file", "") and not set(cells[0]) <= set("-: "):
            yield Expected(cells[0], cells[1], cells[2], cells[3], cells[6])


def asked_care(path: Path) -> Answer:
    try:
        diagnosis = care_core.triage(path).diagnosis
    except CareError as err:
        return Answer("", "refused", err.message, is_silent=True)
    findings = diagnosis.health.findings
    first = f"{findings[0].kind}: {findings[0].title}" if findings else ""
    changes = [] if diagnosis.fix is None else [change.option.name for change in diagnosis.fix.changes]
    return Answer(
        f"{diagnosis.profile.name} {diagnosis.profile.fit.verdict}".strip(),
        _VERDICTS[verdict_of(diagnosis).exit_code],
        first,
        any(one.severity == "critical" for one in findings),
        ", ".join(changes),
        not findings,
    )


def asked_mcp(python: str, path: Path) -> Answer:
    found = _parsed([python, "-c", _ASK_MCP, str(path)]) or []
    told = [one for one in found if one["severity"] != "info"]
    first = f"{told[0]['severity']}: {told[0]['title']}" if told else ""
    return Answer(first=first, is_critical=any(one["severity"] == "critical" for one in told), is_silent=not told)


def asked_flightdx(command: str, path: Path) -> Answer:
    answer = _parsed([command, "--json", str(path)]) or {}
    told = answer.get("incidents") or []
    first = f"{told[0]['severity']}: {told[0]['type']}" if told else ""
    return Answer(first=first, is_critical=any(one["severity"] == "critical" for one in told), is_silent=not told)


def _parsed(command: list[str]) -> Any:
    """The JSON that a command prints; None where it fails."""
    try:
        ran = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, check=False)
        return json.loads(ran.stdout[min(i for i in map(ran.stdout.find, "[{") if i >= 0) :])
    except (OSError, ValueError, subprocess.TimeoutExpired):
        return None


def counts(answers: Mapping[Expected, Answer]) -> str:
    """How often a tool is wrong, in one line."""
    count: Counter[str] = Counter()
    for log, answer in answers.items():
        count["failures"] += log.is_failure
        count["fine"] += log.is_failure and answer.verdict == "OK"
        count["silent"] += log.is_failure and answer.is_silent
        count["changes"] += bool(answer.advice) and log.wants_no_change
        count["healthy"] += log.is_healthy
        count["alarms"] += log.is_healthy and answer.is_critical
    return (
        f"{len(answers)} logs, {count['failures']} failures: {count['fine']} called fine, {count['silent']} without a "
        f"finding; {count['changes']} changes where none is wanted; {count['healthy']} healthy, {count['alarms']} with "
        "a critical finding"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shared", type=Path, default=os.environ.get("CARE_SHARED"), help="folder that holds logs/")
    parser.add_argument("--words", action="store_true", help="print the expert's sentences")
    parser.add_argument("--mcp", metavar="PYTHON", help="a Python that has ardupilot-mcp")
    parser.add_argument("--flightdx", metavar="COMMAND", help="the command of flightdx")
    args = parser.parse_args()
    if args.shared is None:
        parser.error("give --shared DIR or set CARE_SHARED")
    peers: dict[str, Callable[[Path], Answer]] = {}
    if args.mcp:
        peers["ardupilot-mcp"] = lambda path: asked_mcp(args.mcp, path)
    if args.flightdx:
        peers["flightdx"] = lambda path: asked_flightdx(args.flightdx, path)
    folder = args.shared / "logs"
    answers: dict[str, dict[Expected, Answer]] = {name: {} for name in ("care", *peers)}
    words = ["what it is", "an expert says"] if args.words else []
    _row("file", *words, "an expert's kind", "fit", "care ends with", "first finding", "advice", *peers)
    print("|---" * (6 + len(words) + len(peers)) + "|")
    for log in expected(folder / "EXPECTED.md"):
        path = folder / log.file
        if not path.exists():
            continue
        care = answers["care"][log] = asked_care(path)
        others = []
        for name, ask in peers.items():
            is_read = log.file.startswith(_DATAFLASH)
            one = ask(path) if is_read else None
            others.append("not its format" if one is None else one.first or "nothing")
            if one is not None:
                answers[name][log] = one
        told = [log.what, log.says] if args.words else []
        _row(log.file, *told, log.kind, care.fit, care.verdict, care.first, care.advice, *others)
    print()
    for name, said in answers.items():
        print(f"{name}: {counts(said)}")


def _row(*cells: str) -> None:
    print("| " + " | ".join(cell.replace("|", "/").replace("\n", " ") for cell in cells) + " |", flush=True)


if __name__ == "__main__":
    main()

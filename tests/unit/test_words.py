"""The words of the field are used, in the code and on the screen; those that they replaced do not come back."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]

REPLACED_NAMES = {
    "Told": "FindingRow",
    "World": "CounterfactualQuery",
    "At": "Prediction",
    "Levels": "unique_values",
    "kin": "a covariance of errors",
    "Kinship": "a covariance of errors",
    "Moment": "Event",
    "LEADS": "EXPLAINS",
    "persistence": "carry_over",
    "witnesses": "correlated_metrics",
    "ignorance": "epistemic_ratio",
    "Sought": "ObjectiveQuestions",
    "_bury": "_reap",
    "_deaf": "_ignore_signal",
    "_gravity": "severity",
    "Said": "LogMessage",
    "attend": "wait",
    "Sight": "FileStatus",
    "Patience": "StabilityTimeout",
    "Ledger": "WatchBook",
    "Hider": "Redactor",
    "Drawn": "Drawing",
    "RelativeThreshold": "Threshold",
    "OwnLimit": "Threshold",
}
"""Names of classes, functions and variables that may not be defined, with what to write."""

REPLACED_MODULES = {
    "find": "ROS checks",
    "frozen": "records",
    "kept": "profile.cache",
    "mapped": "file_windows",
    "happened": "health",
    "pace": "progress_estimate",
    "remembering": "history_writing",
    "seen": "inputs",
    "spelling": "parameter_aliases",
    "telling": "ranking",
    "together": "fleet_report, shared_causes",
}
"""Names that no module may have, with what to write."""

REPLACED_PHRASES = {
    "nothing out of the ordinary": "no health problems found in what this log records",
    "something the robot met": "something in the environment (wind, obstacle, load)",
    "a part whose failure left no trace": "a hardware fault that this log cannot show",
    "chance: the reference configuration fails": "bad luck: this mission sometimes fails with the reference",
    "judged against the defaults that the log records": "compared with the firmware defaults stored in the log",
    "how alike such runs are": "run-to-run variation was not measured",
    "fits in part": "partly fits",
    "It may be no parameter": "it may not be a parameter",
    "What would tell more": "how to find out more",
    "so its value means nothing": "not judged: the mission was not completed",
    "% probability alone": "if only this is changed",
    "no option of the profile explains": "no parameter of the profile explains",
    "something this log does not show: control was lost": "control was lost; the log does not show why",
    "of this run are off it": "parameters differ",
    "No parameter as far as this explains it": "if this is the cause, changing parameters will not help",
    "Possible are numbers": "allowed: 0.02 to 0.6",
    "off its demand, to and fro": "the roll rate swings 92 deg/s around its target",
    "makes no way": "the controller is stuck: less than 0.3 m in 51 s",
    "quality of service of its publisher": "incompatible QoS between publisher and subscriber",
    "it is not from this file": "this is not the file it used",
    "does not start the node": "the node will not start",
    "a number with a point": "a decimal number",
    "in no distribution from": "is not a parameter of it in any release from foxy to rolling",
}
"""Phrases that may not be printed, with what to write."""


def test_no_replaced_name_is_defined() -> None:
    found = {name: where for where, name in _defined() if name in REPLACED_NAMES}
    assert not found, {name: f"{where}: write {REPLACED_NAMES[name]}" for name, where in found.items()}


def test_no_module_has_a_replaced_name() -> None:
    found = {path: REPLACED_MODULES[path.stem] for path in _sources() if path.stem in REPLACED_MODULES}
    assert not found, {str(path): f"write {word}" for path, word in found.items()}


def test_no_replaced_phrase_is_printed() -> None:
    texts = {path: " ".join(_joined(path).split()) for path in (*_sources(), *_pages())}
    found = {old: path for path, text in texts.items() for old in REPLACED_PHRASES if old in text}
    assert not found, {old: f"{path}: write {REPLACED_PHRASES[old]}" for old, path in found.items()}


def _sources() -> Iterator[Path]:
    return (path for room in ("care_core", "care_tui") for path in (ROOT / room).rglob("*.py"))


def _pages() -> Iterator[Path]:
    yield ROOT / "README.md"
    yield from (ROOT / "docs").glob("*.md")


def _joined(path: Path) -> str:
    """A text with the strings that the code writes in several parts in one."""
    return re.sub(r'"\s*(?:rf|f|r)?"', "", path.read_text(encoding="utf-8"))


def _defined() -> Iterator[tuple[Path, str]]:
    """Names that a module defines; one that holds no replaced name at all need not be parsed for that."""
    replaced = re.compile(rf"\b(?:{'|'.join(map(re.escape, REPLACED_NAMES))})\b")
    for path in _sources():
        text = path.read_text(encoding="utf-8")
        for node in ast.walk(ast.parse(text)) if replaced.search(text) else ():
            if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
                yield path, node.name
            elif isinstance(node, ast.arg):
                yield path, node.arg
            elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                yield path, node.id

"""Rules for any format: the same parameter twice, numbers that are none."""

from __future__ import annotations

import math
from collections.abc import Iterator

from care_core.configs.driven import same_value
from care_core.configs.formats import ConfigFormat
from care_core.lint.records import Document, Entry, Finding, Severity
from care_core.lint.rules import BY_ID
from care_core.run import shown


def found(
    rule: str, severity: Severity, document: Document, entry: Entry, text: str, hint: str = "", source: str = ""
) -> Finding:
    """A finding at an entry; `source` where it is not the rule's own."""
    where = (document.path, entry.line, entry.column, entry.name)
    return Finding(rule, severity, *where, text, hint, source or BY_ID[rule].source)


def check(document: Document) -> Iterator[Finding]:
    """What is wrong with a file whatever it configures."""
    first: dict[tuple[str, ...], Entry] = {}
    for entry in document.entries:
        keys = tuple(part for key in entry.keys for part in key.split("."))
        earlier = first.get(keys)
        if earlier is not None:
            yield _twice(document, earlier, entry)
        first[keys] = entry
        number = entry.number
        is_yaml = document.format in (ConfigFormat.ROS1_YAML, ConfigFormat.ROS2_YAML)
        if number is not None and math.isnan(number) and not is_yaml:
            yield found("wrong-type", Severity.ERROR, document, entry, f"{entry.name} is not a number.", "Give it one.")


def _twice(document: Document, earlier: Entry, entry: Entry) -> Finding:
    same = same_value(earlier.value, entry.value)
    counts = "QGroundControl counts the first" if document.format is ConfigFormat.QGC_PARAMS else "this one counts"
    said = "with the same value" if same else f"there {shown(earlier.value)}, here {shown(entry.value)}: {counts}"
    return found(
        "duplicate",
        Severity.NOTE if same else Severity.WARNING,
        document,
        entry,
        f"{entry.name} is set in line {earlier.line} already, {said}.",
        "Keep one of the two.",
    )

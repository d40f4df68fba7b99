"""Rules for any format: the same parameter twice, numbers that are none."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from difflib import get_close_matches

from care_core.configs.driven import same_value
from care_core.ecosystems.not_numbers import instead
from care_core.ecosystems.px4.dialect import QGC_PARAMS
from care_core.lint.problems import Entry, LintedFile, Problem, Severity
from care_core.metadata import ardupilot, px4
from care_core.run import shown

_ALIKE = 0.8
"""Least likeness of a name to the one that is meant, of difflib."""
_COMPUTED = "whatever is computed with it is no number either"


def near(name: str, known: Iterable[str]) -> str:
    """The known name that another is a slip of the pen for; empty where none is so near. One of the same words in
    another order is the nearest."""
    words = sorted(name.split("_"))
    known = list(known)
    for one in known:
        if sorted(one.split("_")) == words:
            return one
    return next(iter(get_close_matches(name, known, n=1, cutoff=_ALIKE)), "")


def check(file: LintedFile) -> Iterator[Problem]:
    """What is wrong with a file whatever it configures."""
    first: dict[tuple[str, ...], Entry] = {}
    if all(not line.strip() or line.lstrip().startswith("#") for line in file.text.splitlines()):
        nothing = Entry((), "", 1, 1)
        yield file.warning("empty", nothing, "The file holds no parameter.", "Copy it from the robot again.")
    for entry in file.entries:
        keys = tuple(part for key in entry.keys for part in key.split("."))
        earlier = first.get(keys)
        if earlier is not None:
            yield _twice(file, earlier, entry)
        first[keys] = entry
        number = entry.number
        is_yaml = file.format.is_yaml
        if number is not None and math.isnan(number) and not is_yaml:
            text, value = f"{entry.name} is not a number.", instead(entry.name, _default)
            hint = "Put its default back." if value is None else f"Set it to {shown(value)}."
            yield file.error("wrong-type", entry, text, hint, _COMPUTED)


def _default(name: str) -> float | None:
    """The default that every firmware which knows a vehicle's parameter gives it."""
    fact = px4.fact_of(name)
    known = {ardupilot.firmware_default(name, kind) for kind in ardupilot.VEHICLES}
    known |= {fact.default_number} if fact is not None else set()
    told = known - {None}
    return told.pop() if len(told) == 1 else None


def _twice(file: LintedFile, earlier: Entry, entry: Entry) -> Problem:
    same = same_value(earlier.value, entry.value)
    counts = "QGroundControl counts the first" if file.format is QGC_PARAMS else "this one counts"
    said = "with the same value" if same else f"there {shown(earlier.value)}, here {shown(entry.value)}: {counts}"
    return file.problem(
        "duplicate",
        Severity.NOTE if same else Severity.WARNING,
        entry,
        f"{entry.name} is set in line {earlier.line} already, {said}.",
        "Keep one of the two.",
    )

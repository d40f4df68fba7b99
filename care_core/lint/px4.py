"""Rules for the parameters of PX4: names by release, types, ranges, listed values."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Collection, Iterator, Sequence

from care_core.ecosystems.px4.dialect import QGC_PARAMS
from care_core.ecosystems.vehicles.self_written import is_self_written
from care_core.lint.documented import meant_instead, not_listed, share_known, unknown_bits
from care_core.lint.problems import Entry, LintedFile, Problem, Severity
from care_core.metadata import px4
from care_core.metadata.fact import Fact
from care_core.records import replace

_VERSION = re.compile(r"^#\s*(?:Version:|Firmware: PX4)\s*v?(\d+\.\d+)(?P<build>.*)", re.MULTILINE)
_EARLY = re.compile(r"alpha|beta|rc|dev", re.IGNORECASE)
"""Builds before a release: they still have what it leaves out."""
_LISTS = f"{px4.SOURCE}s of {px4.RELEASES[0]} to {px4.RELEASES[-1]}"
_TRANSLATED = "param_translation.cpp of PX4, which translates files of older releases"
_FAR = 2.0
"""The firmware checks no range: what lies beyond one by less than this factor is worth a note alone."""
_BYTEWISE = "MAVLink's two encodings of parameters: PX4 sends whole numbers byte by byte"
_UNSET = (0.0, -1.0)
"""Values that say "off", "not known" or "not set" of many parameters."""


def releases_of(file: LintedFile, target: str) -> tuple[tuple[str, ...], bool]:
    """The releases that a file may be for, and whether anybody says so.

    Args:
        target: what the operator says: `px4-1.15`; empty where nothing is said.
    """
    told, is_early = (target.partition("-")[2], False) if target else _header(file.text)
    if told in px4.RELEASES:
        place = px4.RELEASES.index(told)
        return px4.RELEASES[max(place - is_early, 0) : place + 1], True
    counts = Counter(release for entry in file.entries for release in px4.known_in(entry.name))
    most = max(counts.values(), default=0)
    return tuple(release for release in px4.RELEASES if counts[release] == most), False


def _header(text: str) -> tuple[str, bool]:
    """The release that QGroundControl, or `care params`, writes above the parameters, and whether it is a build before
    it."""
    match = _VERSION.search(text)
    return (match[1], bool(_EARLY.search(match["build"]))) if match else ("", False)


def check(file: LintedFile, target: str) -> Iterator[Problem]:
    """What is wrong with a file of PX4's parameters."""
    releases, is_told = releases_of(file, target)
    is_newer = not target and _number(_header(file.text)[0]) > _number(px4.RELEASES[-1])
    for entry in file.entries:
        known = px4.known_in(entry.name)
        if not known:
            yield from () if is_newer else (_unknown(file, entry),)
        elif not known & set(releases):
            yield _elsewhere(file, entry, releases, is_told=is_told)
        elif not is_self_written(entry.name):
            yield from _value(file, entry, px4.facts_of(entry.name, releases))


def read_as_numbers(file: LintedFile) -> tuple[LintedFile, tuple[Problem, ...]]:
    """A file without its whole numbers where they were stored byte by byte as decimal ones, as MAVProxy stores those
    of PX4: 1 is then next to 0, and -1 no number."""
    whole = [entry for entry in file.entries if _is_whole(entry.name)]
    broken = [entry for entry in whole if entry.number is not None and math.isnan(entry.number)]
    if not broken or file.format is QGC_PARAMS:
        return file, ()
    text = f"{broken[0].name} is not a number, nor is any of the {len(whole)} whole numbers here what the vehicle has: "
    text += "they were stored byte by byte as decimal ones."
    hint = "Save the file with QGroundControl, or `param show` of PX4 itself. They are not judged here."
    problem = file.error("wrong-type", broken[0], text, hint, _BYTEWISE)
    kept = tuple(entry for entry in file.entries if entry not in whole)
    return replace(file, entries=kept), (problem,)


def _is_whole(name: str) -> bool:
    facts = px4.facts_of(name)
    return bool(facts) and all(fact.type in ("int", "bool") for fact in facts)


def _number(release: str) -> tuple[int, ...]:
    return tuple(map(int, release.split("."))) if release else ()


def _unknown(file: LintedFile, entry: Entry) -> Problem:
    meant = meant_instead(entry.name, {one.name for one in file.entries}, px4.names())
    if meant:
        text = f"No release of PX4 from {px4.RELEASES[0]} on has a parameter {entry.name}."
        return file.warning("unknown-key", entry, text, f"Did you mean {meant}?", _LISTS)
    text = f"PX4's lists have no parameter {entry.name}: a custom build's, or of an older release."
    return file.note("unknown-key", entry, text, "Check its spelling.", _LISTS)


def _elsewhere(file: LintedFile, entry: Entry, releases: Sequence[str], *, is_told: bool) -> Problem:
    """A name of other releases than those the file is for."""
    told = px4.span(releases) if is_told else f"the releases that know most of this file ({px4.span(releases)})"
    new, factor = px4.RENAMED.get(entry.name, ("", 1.0))
    if px4.known_in(new) & set(releases):
        hint = f"Write {new}{'' if factor == 1 else f', and its value times {factor:.4g}'}."
        severity = Severity.WARNING if is_told else Severity.NOTE
        return file.problem("renamed", severity, entry, f"{entry.name} is {new} in {told}.", hint, _TRANSLATED)
    text = f"{entry.name} is not in {told}, but in {px4.span(px4.known_in(entry.name))}."
    severity = Severity.WARNING if is_told else Severity.NOTE
    return file.problem("unknown-key", severity, entry, text, "Is the file for this firmware?", _LISTS)


def _value(file: LintedFile, entry: Entry, facts: Sequence[Fact]) -> Iterator[Problem]:
    """A value that no release that the file may be for documents; the default of one always is."""
    value = entry.number
    if value is None or math.isnan(value) or any(value == fact.default_number for fact in facts):
        return
    fact, unit = facts[-1], f" {facts[-1].unit}" if facts[-1].unit else ""
    if all(one.type in ("int", "bool") for one in facts) and not value.is_integer():
        text = f"{entry.name} is {value:g}, and PX4 counts it in whole numbers."
        yield file.warning("wrong-type", entry, text, "", fact.source)
    elif all(one.bits for one in facts):
        yield from unknown_bits(file, entry, value, facts)
    elif all(one.values for one in facts):
        if not any(value == code for one in facts for code, _ in one.values):
            yield not_listed(file, entry, value, fact)
    elif not any(one.allows(value) for one in facts):
        severity = Severity.WARNING if all(_is_far(value, one) for one in facts) else Severity.NOTE
        text = f"{entry.name} is {value:g}{unit}, outside {_range(fact)}."
        hint = "The firmware takes it all the same."
        yield file.problem("out-of-range", severity, entry, text, hint, fact.source)


def _is_far(value: float, fact: Fact) -> bool:
    """Whether a value is of another magnitude, or sign, than the documented ones."""
    if value in _UNSET:
        return False
    is_above = fact.high is not None and fact.high > 0 and value > _FAR * fact.high
    is_below = fact.low is not None and (value < 0 <= fact.low or 0 < value < fact.low / _FAR)
    return is_above or is_below


def _range(fact: Fact) -> str:
    if fact.high is None:
        return f"{fact.low:g} and above"
    return f"up to {fact.high:g}" if fact.low is None else f"{fact.low:g} to {fact.high:g}"


def known(names: Collection[str]) -> float:
    """The share of these that are PX4's parameters."""
    return share_known(names, px4.known_in)

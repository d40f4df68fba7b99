"""Rules for the parameters of ArduPilot vehicles: names by release, ranges, listed values."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from typing import TypeVar

from care_core.ecosystems.vehicles.self_written import SIMULATOR_PREFIX, is_self_written
from care_core.ecosystems.vehicles.vehicle import Kind
from care_core.lint.documented import meant_instead, not_listed, share_known, unknown_bits
from care_core.lint.problems import Entry, LintedFile, Problem, Severity
from care_core.metadata import ardupilot
from care_core.metadata.aliases import aliases_of
from care_core.metadata.ardupilot import Release
from care_core.metadata.fact import Fact

_T = TypeVar("_T")
_VEHICLE_LINE = re.compile(
    r"#.*\b(?:ardu)?(copter|helicopter|multirotor|plane|rover|sub|tracker|blimp)\b", re.IGNORECASE
)
_VERSION_LINE = re.compile(r"#.*?\b[Vv]?(?:ersion:?\s*)?(\d\.\d+)\b")
_LETTERS = {
    "copter": "C", "helicopter": "C", "multirotor": "C", "plane": "P", "rover": "R", "sub": "S", "tracker": "T",
    "blimp": "B",
}  # fmt: skip
_KINDS: dict[str, Kind] = {"C": "copter", "P": "quadplane", "R": "rover", "S": "sub", "T": "tracker", "B": "blimp"}
_LISTS = f"{ardupilot.SOURCE}s of 3.4 to 4.8"
_NUMBER = re.compile(r"\d+")
_HEAD = 12
"""Lines in which ground stations say of what vehicle a file is."""
_RATIOS = ((100.0, "centimetres or hundredths"), (1000.0, "thousandths"))
_COMPLETE = (4, 1)
"""The lists of earlier releases leave many parameters out: groups of helicopters and controllers."""
_CHOICES, _GAPS = 4, 0.3
"""Least number of values of a list of choices, and the most of them that may be missing in between, as a share."""
_SIMULATED = (10.0, 100.0)
"""Drivers of simulated sensors, which lists leave out."""
_OLDER = frozenset({"ATC_ACCEL_RP_MAX", "ATC_RATE_RP_MAX", "FS_GPS_ENABLE", "MOT_SPIN_ARMED"})
"""Names of Copter 3.3 and before that are like one of today which counts something else."""
_OWN_DEFAULTS = {"EK2_ABIAS_P_NSE": 0.005, "ATC_ACCEL_Y_MAX": 110000.0}
"""Defaults outside the documented ranges, of parameters that no bundled profile has (AP_NavEKF2.cpp,
AC_AttitudeControl_Sub.h)."""
_FAR = 10.0
"""Documented ranges are what is usual: what lies beyond the bound by less than this factor is worth a note alone."""


def releases_of(file: LintedFile, target: str) -> tuple[tuple[Release, ...], bool]:
    """The releases that a file may be for, and whether anybody says so.

    Args:
        target: what the operator says: `copter-4.5`, `rover`; empty where nothing is said.
    """
    asked = _releases_of(*_words(target)) if target else _releases_of(*_header(file.text))
    if asked:
        return asked, True
    known = {entry.name: ardupilot.known_in(entry.name) for entry in file.entries}
    groups = {(_NUMBER.sub("", name), one.vehicle) for name, releases in known.items() for one in releases}
    likely = _most(Counter(vehicle for _, vehicle in groups))
    counts = Counter(one for releases in known.values() for one in releases if one.vehicle in likely)
    return tuple(one for one in ardupilot.ALL if one in _most(counts)), False


def _most(counts: Counter[_T]) -> set[_T]:
    """What was counted most often. The vehicle comes first, and sixteen channels count once: a file older than any
    list has most of its names in common with the oldest, whatever vehicle that is of."""
    most = max(counts.values(), default=0)
    return {one for one, count in counts.items() if count == most}


def _words(target: str) -> tuple[str, str]:
    vehicle, _, version = target.casefold().partition("-")
    return _LETTERS.get(vehicle.removeprefix("ardu"), ""), version


def _header(text: str) -> tuple[str, str]:
    head = text.splitlines()[:_HEAD]
    vehicle = next((match[1].casefold() for line in head if (match := _VEHICLE_LINE.match(line))), "")
    if not vehicle:
        return "", ""
    version = next((match[1] for line in head if (match := _VERSION_LINE.match(line))), "")
    return _LETTERS[vehicle], version


def _releases_of(letter: str, version: str) -> tuple[Release, ...]:
    own = tuple(one for one in ardupilot.ALL if one.vehicle == letter)
    return tuple(one for one in own if one.version == version) or own


def check(file: LintedFile, target: str) -> Iterator[Problem]:
    """What is wrong with a file of an ArduPilot vehicle's parameters."""
    releases, is_told = releases_of(file, target)
    for entry in file.entries:
        if entry.name.startswith(SIMULATOR_PREFIX):
            continue
        known = ardupilot.known_in(entry.name)
        if not known:
            yield _unknown(file, entry)
        elif not known & set(releases):
            yield _elsewhere(file, entry, releases, is_told)
        elif not is_self_written(entry.name):
            yield from _value(file, entry, ardupilot.facts_of(entry.name, releases))


def _unknown(file: LintedFile, entry: Entry) -> Problem:
    is_older = entry.name in _OLDER
    meant = "" if is_older else meant_instead(entry.name, {one.name for one in file.entries}, ardupilot.names())
    if meant:
        text = f"No release of ArduPilot from 3.4 on has a parameter {entry.name}."
        return file.warning("unknown-key", entry, text, f"Did you mean {meant}?", _LISTS)
    text = f"ArduPilot's lists have no parameter {entry.name}: a script's, a custom build's, or one before 3.4."
    return file.note("unknown-key", entry, text, "Check its spelling.", _LISTS)


def _elsewhere(file: LintedFile, entry: Entry, releases: Sequence[Release], is_told: bool) -> Problem:
    """A name of other releases than those the file is for."""
    new = _renamed(entry.name, releases)
    is_sure = is_told and (new is not None or all(_parts(one) >= _COMPLETE for one in releases))
    severity = Severity.WARNING if is_sure else Severity.NOTE
    told = (
        _release_span(releases) if is_told else f"the releases that know most of this file ({_release_span(releases)})"
    )
    known_in = [one for one in ardupilot.ALL if one in ardupilot.known_in(entry.name)]
    own = [one for one in known_in if one.vehicle in {release.vehicle for release in releases}]
    known = _release_span(own or known_in)
    if new:
        return file.problem("renamed", severity, entry, f"{entry.name} is {new[0]} in {told}.", new[1], _LISTS)
    text = f"{entry.name} is not in {told}, but in {known}."
    return file.problem("unknown-key", severity, entry, text, "Is the file for this firmware?", _LISTS)


def _renamed(name: str, releases: Sequence[Release]) -> tuple[str, str] | None:
    for release in releases:
        for one in aliases_of(name, _KINDS[release.vehicle]):
            if one.name != name and release in ardupilot.known_in(one.name):
                scale = "" if one.scale == 1 else f", and its value times {one.scale:g}"
                return one.name, f"Write {one.name}{scale}."
    return None


def _release_span(releases: Sequence[Release]) -> str:
    if len(releases) == 1:
        return str(releases[0])
    vehicles = list(dict.fromkeys(one.vehicle for one in releases))
    if len(vehicles) > 1:
        return ", ".join(ardupilot.NAMES[vehicle] for vehicle in vehicles)
    return f"{releases[0]} to {releases[-1].version}"


def _value(file: LintedFile, entry: Entry, facts: Sequence[Fact]) -> Iterator[Problem]:
    """A value that no release that the file may be for allows."""
    value = entry.number
    if value is None or math.isnan(value) or not facts:
        return
    fact = facts[-1]
    bounded = [one for one in facts if one.low is not None and one.high is not None]
    if len(bounded) == len(facts):
        if not any(one.allows(value) for one in bounded):
            yield from _outside(file, entry, value, bounded)
    elif all(_is_enumeration(one) for one in facts):
        ever = {code for one in ardupilot.facts_of(entry.name) for code, _ in one.values}
        if value not in {*ever, 0.0, -1.0} and not (value in _SIMULATED and entry.name.endswith("_TYPE")):
            yield not_listed(file, entry, value, fact)
    elif all(one.bits for one in facts):
        yield from unknown_bits(file, entry, value, facts)


def _is_enumeration(fact: Fact) -> bool:
    """Whether a list of values is all there is: choices that are counted from 0 or 1, not presets of a number."""
    codes = [code for code, _ in fact.values if code >= 0]
    if fact.low is not None or fact.bits or len(codes) < _CHOICES or not all(code.is_integer() for code in codes):
        return False
    return min(codes) <= 1 and max(codes) + 1 - len(codes) <= len(codes) * _GAPS


def _parts(release: Release) -> tuple[int, ...]:
    return tuple(map(int, release.version.split(".")))


def _outside(file: LintedFile, entry: Entry, value: float, facts: Sequence[Fact]) -> Iterator[Problem]:
    """A number outside the documented ranges. 0 and -1 mean "off" or "not set" for many parameters and are let be."""
    fact = facts[-1]
    low, high = fact.low or 0.0, fact.high or 0.0
    if value in (0.0, -1.0) or _is_default(entry.name, value):
        return
    unit = f" {fact.unit}" if fact.unit else ""
    text = f"{entry.name} is {value:g}{unit}, outside {low:g} to {high:g}."
    for ratio, words in _RATIOS:
        fits = [scaled for scaled in (value / ratio, value * ratio) if low < scaled < high]
        if low >= 0 and value > 0 and fits and not low / _FAR <= value <= high * _FAR:
            hint = f"Is it in {words}? {fits[0]:g} would be within the range."
            yield file.warning("wrong-unit", entry, text, hint, fact.source)
            return
    yield file.note("out-of-range", entry, text, "The range is what is usual.", fact.source)


def _is_default(name: str, value: float) -> bool:
    """Whether the firmware of some vehicle has this value by itself: a few of its defaults are outside its ranges."""
    own = name.removeprefix("Q_")
    defaults = (_OWN_DEFAULTS.get(own), *(ardupilot.firmware_default(own, kind) for kind in ardupilot.VEHICLES))
    return any(math.isclose(one, value, rel_tol=1e-6) for one in defaults if one is not None)


def known(names: Collection[str]) -> float:
    """The share of these that are ArduPilot's parameters: it has few names in common with PX4."""
    return share_known(names, ardupilot.known_in)

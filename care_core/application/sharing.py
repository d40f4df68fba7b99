"""What goes to strangers: a diagnosis without places, or without anything that says whose robot it was.

A log holds names in many places: its path, the texts that its software and its operator wrote, namespaces of topics,
text parameters. No list of such names exists, so it is the other way round: a word stays only where it is one that
firmware, navigation stacks and this program use (`public_words.txt`). A message with any other word is left out whole;
elsewhere the word is. Numbers that are dates, coordinates, addresses or serial numbers go by their shape.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from enum import Enum
from pathlib import Path
from typing import TypeVar, cast

from care_core.application.open_run import OpenRun
from care_core.diagnose.records import Diagnosis
from care_core.ecosystems.findings import Event
from care_core.records import Record, replace
from care_core.variables import Variable

NO_PLACE = "(position left out)"
LEFT_OUT = "(text left out)"
ELSEWHERE = "not CaRE's own"
"""Of a profile, without the folder that it lies in."""
HIDDEN = "\u2026"

_NUMBER = r"[-+]?\d+(?:\.\d+)?"
_DEGREE = r"\s*\N{DEGREE SIGN}?\s*[NSEW]?"
_PLACES = re.compile(
    rf"""
    \(\s*{_NUMBER}\s*,\s*{_NUMBER}(?:\s*,\s*{_NUMBER})?\s*\)                        # (4.2, 0.1)
    | \b(?:lat(?:itude)?|lng|lon(?:g|gitude)?|easting|northing|utm)\b\W{{0,3}}{_NUMBER}(?:\s*[NSEW]\b)?  # lat: -35.3
    | \b[xyz]\s*[:=]\s*{_NUMBER}                                                    # x=4.2
    | [-+]?\d{{1,3}}\.\d{{3,}}{_DEGREE}\s*[,;/ ]\s*[-+]?\d{{1,3}}\.\d{{3,}}{_DEGREE}       # -35.3633, 149.1652
    | [-+]?\d{{2,3}}\.\d{{5,}}                                                      # one coordinate in degrees
    | \d{{1,3}}\s*\N{{DEGREE SIGN}}\s*\d{{1,2}}\s*['\u2032][^,;]{{0,12}}?[NSEW]\b          # 47° 23' 51" N
    | \b\d{{4,5}}\.\d+\s*,\s*[NSEW]\b                                               # NMEA
    | \b\d{{1,2}}[C-X][A-HJ-NP-Z]{{2}}\s?\d{{4,10}}\b                               # MGRS
    """,
    re.VERBOSE | re.IGNORECASE,
)
_IDENTITIES = re.compile(
    r"""
    [\w.+-]+@[\w-]+(?:\.[\w-]+)*                        # mail, user@host
    | \b[a-z][a-z0-9+.-]*://\S+                         # URL
    | \b\d{1,3}(?:\.\d{1,3}){3}(?::\d+)?\b              # IPv4
    | \b(?:[0-9a-f]{2}[:-]){5}[0-9a-f]{2}\b             # MAC
    | \b(?:[0-9a-f]{1,4}:){3,7}[0-9a-f]{1,4}\b          # IPv6
    | (?:~|\b[a-z]:)[\\/][^\s,;:'"]*                     # ~/logs, C:\logs
    | /(?:home|users|root|mnt|media|tmp|var|opt|data|srv|etc|usr|run|sdcard|fs|log|logs)/[^\s,;:'"]*
    | \b\d{4}[-/.]\d{1,2}[-/.]\d{1,2}(?:[T_ ]?\d{1,2}[-:]?\d{2}(?:[-:]?\d{2}(?:\.\d+)?)?(?:Z|[+-]\d{2}:?\d{2})?)?\b
    | \b\d{1,2}(?:\.\d{1,2}\.|/\d{1,2}/)\d{4}\b | \b\d{1,2}/\d{1,2}/\d{2}\b
    | \b\d{1,2}(?:st|nd|rd|th|\.)?\s+(?:jan|feb|mar|apr|may|jun|jul|aug|sep|oct|nov|dec)[a-z]*\.?(?:,?\s+\d{4})?\b
    | \b(?:jan|feb|mar|apr|jun|jul|aug|sep|oct|nov|dec)[a-z]*\.?\s+\d{1,2}(?:st|nd|rd|th)?(?:,?\s+\d{4})?\b
    | \b(?=[0-9a-f]*\d)[0-9a-f]{7,}\b                   # serial numbers, hashes, seconds since 1970
    | \b(?=\w*\d\w*\d\w*\d)(?=\w*[a-z])\w{6,}\b         # 1A2B3C4D, SN003451
    | \+\d[\d ()-]{7,}\d                                # telephone
    """,
    re.VERBOSE | re.IGNORECASE,
)
R = TypeVar("R", bound=OpenRun)

_WORD = re.compile(r"[^\W\d_]+")
_TEXTUAL = {"message", "error", "warning", "event", "arming", "failsafe", "crash", "recovery", "mission", "vehicle"}
"""Kinds of moments that may hold what the robot's software wrote."""


class Sharing(Record):
    """What of a run may go to strangers."""

    positions: bool = True
    anonymous: bool = False

    def of(self, case: R) -> R:
        """The case with the rest left out of its diagnosis. Its log stays what it is."""
        if self.anonymous:
            return replace(case, diagnosis=self.hider(case).diagnosis(case.diagnosis))
        if not self.positions:
            return replace(case, diagnosis=cast("Diagnosis", mapped(case.diagnosis, without_places)))
        return case

    def hider(self, case: OpenRun) -> Redactor:
        """What hides the words of this case's log."""
        return Redactor(public_words(case), positions=self.positions)

    def text(self, case: OpenRun) -> Callable[[str], str]:
        """How a text of the case is to be written."""
        if self.anonymous:
            return self.hider(case).text
        return str if self.positions else without_places


EVERYTHING = Sharing()


def without_places(text: str) -> str:
    """The text without coordinates, on the earth or on a map."""
    return _PLACES.sub(NO_PLACE, text)


class Redactor(Record):
    """Leaves out what says whose robot it was; the words in `public` say nothing of that, and single letters."""

    public: frozenset[str]
    positions: bool = False

    def text(self, text: str) -> str:
        """The text with every such word and number hidden."""
        kept = text if self.positions else without_places(text)
        kept = _IDENTITIES.sub(HIDDEN, kept)
        return _WORD.sub(lambda match: match[0] if self._is_public(match[0]) else HIDDEN, kept)

    def _is_public(self, word: str) -> bool:
        return len(word) == 1 or word.casefold() in self.public

    def said(self, text: str) -> str:
        """A text that the robot's software wrote: whole, or not at all."""
        hidden = self.text(text)
        return LEFT_OUT if HIDDEN in hidden else hidden

    def diagnosis(self, diagnosis: Diagnosis) -> Diagnosis:
        """The diagnosis without its log's name, place, hash and date, and with every text hidden that needs it."""
        run, health = diagnosis.run, diagnosis.health
        log = replace(run.log, path=f"log{Path(run.log.path).suffix}", start=None, sha256="", robot=None)
        timeline = tuple(self._event(one) for one in health.timeline)
        evidence = tuple(replace(one, text=self.said(one.text)) for one in run.evidence)
        since = diagnosis.since and replace(diagnosis.since, log="good log")
        profile = replace(diagnosis.profile, origin=ELSEWHERE if diagnosis.profile.origin else "")
        told = replace(
            diagnosis,
            profile=profile,
            run=replace(run, log=log, evidence=evidence),
            health=replace(health, timeline=timeline, robot=self.text(health.robot)),
            since=since,
        )
        return cast("Diagnosis", mapped(told, self.text))

    def _event(self, one: Event) -> Event:
        if one.kind not in _TEXTUAL:
            return one
        text = self.text(one.text) if one.kind in ("vehicle", "mission") else self.said(one.text)
        return replace(one, text=text)


def mapped(value: object, change: Callable[[str], str]) -> object:
    """A plain value with every text in it changed; names of variables are the profile's and stay."""
    if isinstance(value, str):
        return value if isinstance(value, Enum) else change(value)
    if isinstance(value, Variable):
        limit = value.threshold
        if limit is not None and limit.source:
            limit = replace(limit, source=change(limit.source))
        return replace(value, threshold=limit, parameters=tuple(map(change, value.parameters)))
    if isinstance(value, Record):
        parts = {name: mapped(getattr(value, name), change) for name in value.__struct_fields__}
        return replace(value, **parts)
    if isinstance(value, Mapping):
        return {mapped(name, change): mapped(part, change) for name, part in value.items()}
    if isinstance(value, tuple):
        return tuple(mapped(part, change) for part in value)
    return value


def public_words(case: OpenRun) -> frozenset[str]:
    """Words of firmware, navigation stacks, this program and the case's profile."""
    listed = Path(__file__).with_name("public_words.txt").read_text(encoding="utf-8").split()
    known = case.schema.variables.values() if case.schema else case.options
    return frozenset((*listed, *(word for variable in known for word in _words_of(variable))))


def _words_of(variable: Variable) -> Iterator[str]:
    """The words of a variable's name and of its parameters, without the namespaces that a robot puts before them."""
    parameters = (name.rsplit("/", 1)[-1] for name in variable.parameters)
    texts = (variable.name, variable.unit, *parameters, *(label for _, label in variable.labels))
    return (match[0].casefold() for text in texts for match in _WORD.finditer(text))

"""How the words of a log are hidden from strangers.

A log holds names in many places: its path, the texts that its software and its operator wrote, namespaces of topics,
text parameters. No list of such names exists, so it is the other way round: a word stays only where it is one that
firmware, navigation stacks and this program use (`public_words.txt`). A message with any other word is left out whole;
elsewhere the word is. Numbers that are dates, coordinates, addresses or serial numbers, and names with digits, go by
their shape (`identities`).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from enum import Enum
from pathlib import Path
from typing import cast

from care_core.application.identities import IDENTITIES, PLACES, has_number, private_names, squeezed
from care_core.application.open_run import OpenRun
from care_core.application.shared_parameters import may_go
from care_core.diagnose.records import Diagnosis
from care_core.ecosystems.findings import Event
from care_core.files import read_small_text
from care_core.records import Record, replace
from care_core.variables import Variable

NO_PLACE = "(position left out)"
LEFT_OUT = "(text left out)"
ELSEWHERE = "not CaRE's own"
"""Of a profile, without the folder that it lies in."""
HIDDEN = "\u2026"

_WORD = re.compile(r"[^\W\d_]+")
_NAMES = re.compile(r"\w*\d\w*")
_TEXTUAL = {"message", "error", "warning", "event", "arming", "failsafe", "crash", "recovery", "mission", "vehicle"}
"""Kinds of moments that may hold what the robot's software wrote."""


def without_places(text: str) -> str:
    """The text without coordinates, on the earth or on a map."""
    return PLACES.sub(NO_PLACE, squeezed(text))


def diagnosis_without_places(diagnosis: Diagnosis) -> Diagnosis:
    """The diagnosis without coordinates in any of its texts."""
    return cast("Diagnosis", mapped(diagnosis, without_places))


def redactor_of(case: OpenRun, *, positions: bool) -> Redactor:
    """What hides the words of this case's log."""
    return Redactor(public_words(case), positions, known_names(case), parameters_of(case))


class Redactor(Record):
    """Leaves out what says whose robot it was; the words in `public` say nothing of that, single letters, and the
    names in `known`."""

    public: frozenset[str]
    positions: bool = False
    known: frozenset[str] = frozenset()
    parameters: frozenset[str] = frozenset()
    """The profile's, whose values may go."""

    def text(self, text: str) -> str:
        """The text with every such word and number hidden."""
        kept = squeezed(text) if self.positions else without_places(text)
        kept = IDENTITIES.sub(HIDDEN, kept)
        pieces, done = [], 0
        for start, end in sorted(private_names(kept, self.public, self.known)):
            pieces += [kept[done:start], HIDDEN]
            done = end
        return "".join((*pieces, kept[done:]))

    def said(self, text: str) -> str:
        """A text that the robot's software wrote: whole, or not at all."""
        hidden = self.text(text)
        return LEFT_OUT if HIDDEN in hidden or NO_PLACE in hidden or has_number(hidden) else hidden

    def diagnosis(self, diagnosis: Diagnosis) -> Diagnosis:
        """The diagnosis without its log's name, place, hash and date, and with every text hidden that needs it."""
        run, health = diagnosis.run, diagnosis.health
        log = replace(run.log, path=f"log{Path(run.log.path).suffix}", start=None, sha256="", robot=None)
        timeline = tuple(self._event(one) for one in health.timeline)
        evidence = tuple(replace(one, text=self.said(one.text)) for one in run.evidence)
        since = diagnosis.since and replace(
            diagnosis.since,
            log="good log",
            changes=tuple(
                one for one in diagnosis.since.changes if may_go(one.parameter, self.parameters, run.log.format)
            ),
        )
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
    listed = read_small_text(Path(__file__).with_name("public_words.txt")).split()
    return frozenset((*listed, *(word for variable in _variables(case) for word in _words_of(variable))))


def known_names(case: OpenRun) -> frozenset[str]:
    """Names with digits that are not the robot's own: of the profile's variables, and of firmware's parameters."""
    from care_core.metadata import ardupilot

    own = (name for one in _variables(case) for name in (one.name, *(p.rsplit("/", 1)[-1] for p in one.parameters)))
    found = (match[0] for name in own for match in _NAMES.finditer(name))
    return frozenset(name.casefold() for name in (*found, *ardupilot.names()))


def parameters_of(case: OpenRun) -> frozenset[str]:
    """Names of the parameters of the profile's options."""
    return frozenset(name for one in (*_variables(case), *case.options) for name in one.parameters)


def _variables(case: OpenRun) -> Iterable[Variable]:
    return case.schema.variables.values() if case.schema else case.options


def _words_of(variable: Variable) -> Iterator[str]:
    """The words of a variable's name and of its parameters, without the namespaces that a robot puts before them."""
    parameters = (name.rsplit("/", 1)[-1] for name in variable.parameters)
    texts = (variable.name, variable.unit, *parameters, *(label for _, label in variable.labels))
    return (match[0].casefold() for text in texts for match in _WORD.finditer(text))

"""A platform as the rest of the core sees it. Its file, `profile.yaml`, is checked in `schema_file`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, Literal

from care_core.causal.nominal import Nominal, nominal
from care_core.configs.driven import same_value
from care_core.constraints import Constraint
from care_core.records import Record, field, replace
from care_core.run import Evidence
from care_core.variables import Role, Threshold, Variable

Side = Literal["low", "high"]
"""On which side of what training saw a value is bad."""


_LOOKED_AT = 1000
"""Characters of a message that rules are held against."""


class EvidenceRule(Record):
    """What a message of the log says about a mission: the options that its check reads, or what the run met."""

    text: str
    """A regular expression, searched in the message, ignoring case."""
    options: Mapping[str, Threshold | None]
    """The value that sets the check off; None: any value but the default."""
    says: str = ""
    """The check in an operator's words."""
    circumstance: str | None = None
    """What the run met, where the message speaks of no parameter."""

    @property
    def pattern(self) -> re.Pattern[str]:
        """The expression compiled, which takes longer than all else of a profile that is not chosen in the end."""
        return re.compile(self.text, re.IGNORECASE)

    def points_at(self, variables: Mapping[str, Variable], config: Mapping[str, float]) -> tuple[str, ...]:
        """The rule's options whose value in this run sets the check off; an option of unknown value may."""
        return tuple(
            name
            for name, bound in self.options.items()
            if name not in config
            or (bound.met(config[name]) if bound is not None else not _is_default(variables[name], config[name]))
        )


def _is_default(option: Variable, value: float) -> bool:
    return option.default is not None and same_value(value, option.default)


class Schema(Record):
    """A platform as people described it. `variables` keeps the order of the file."""

    name: str
    version: str
    platform: str
    doc: str
    match: Mapping[str, str]
    """What the log's facts should contain: `firmware`, `frame`, `stack`; the kind of `vehicle` (only those given)."""
    logs: tuple[str, ...]
    """Formats this platform records (`dataflash-bin`, `ros1-bag`); empty for a published table."""
    observational: bool
    """True when operators chose options by what they met, so context may cause options (DESIGN section 6)."""
    mission: Mapping[str, Any]
    evidence: tuple[EvidenceRule, ...]
    """What messages of the log point at."""
    variables: Mapping[str, Variable]
    circumstances: Mapping[str, Mapping[str, Side]] = field(default_factory=dict)
    """What no parameter sets (wind, battery) -> the contexts and metrics that show it, and their bad side."""
    known: frozenset[tuple[str, str]] = frozenset()
    """(cause, effect): direct effects that people know to be possible. Data say how large they are."""
    carried_over: str = ""
    """What the profile was learned from, where that is not what its logs are of: then it names suspects and advises no
    change. Empty where it is."""
    constraints: tuple[Constraint, ...] = ()
    """What the stack asks of its options together: no suggestion and no mission of a campaign breaks it."""
    plugins: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Parameter that names a part of the stack -> what its value contains one of where it is a part learned from."""
    firmware_window: tuple[tuple[int, ...], tuple[int, ...]] | None = None
    """First and last version of the firmware that the profile is good for, as far as each is written."""
    digest: str = ""
    """SHA-256 of the variables' names, roles, types, ranges and extraction: what a model was learned for."""

    def of(self, role: Role) -> tuple[Variable, ...]:
        return tuple(v for v in self.variables.values() if v.role is role)

    @property
    def options(self) -> tuple[Variable, ...]:
        return self.of(Role.OPTION)

    @property
    def contexts(self) -> tuple[Variable, ...]:
        return self.of(Role.CONTEXT)

    @property
    def metrics(self) -> tuple[Variable, ...]:
        return self.of(Role.METRIC)

    @property
    def objectives(self) -> tuple[Variable, ...]:
        return self.of(Role.OBJECTIVE)

    @property
    def travels(self) -> bool:
        """Whether any mission is judged, and not the profile's own alone."""
        return any(objective.relative is not None for objective in self.objectives)

    @property
    def asked(self) -> tuple[Variable, ...]:
        """The contexts that tell of the mission."""
        return tuple(v for v in self.contexts if v.about == "mission")

    @property
    def learned_elsewhere(self) -> str:
        """Why no log is of what a carried-over profile was learned from; empty for any other."""
        return f"the profile was learned from {self.carried_over}" if self.carried_over else ""

    def pointed(self, evidence: Evidence, config: Mapping[str, float]) -> Evidence:
        """What a run says, with what the rules read out of its text."""
        rules = [rule for rule in self.evidence if rule.pattern.search(evidence.text, 0, _LOOKED_AT)]
        named = [option for rule in rules for option in rule.points_at(self.variables, config)]
        return replace(
            evidence,
            options=tuple(dict.fromkeys((*evidence.options, *named))),
            says=next((rule.says for rule in rules if rule.says), evidence.says),
            circumstance=next((rule.circumstance for rule in rules if rule.circumstance), evidence.circumstance),
        )

    def nominal_of(self, name: str) -> Nominal | None:
        """What physics says a variable is, None where the profile names no formula for it."""
        declared = self.variables[name].nominal
        return None if declared is None else nominal(declared.kind, declared.args, self._units)

    def typical_of(self, name: str) -> Nominal | None:
        """What a context about the vehicle usually is, None where the profile names no formula for it."""
        declared = self.variables[name].typical
        return None if declared is None else nominal(declared.kind, {}, self._units)

    @property
    def _units(self) -> dict[str, str]:
        return {v.name: v.unit for v in self.variables.values()}

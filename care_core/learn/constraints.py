"""What a schema rules out before any data is seen, each rule with its reason (paper, section III-A)."""

from __future__ import annotations

from collections.abc import Mapping

from care_core.profile.schema import Schema
from care_core.records import Record, field
from care_core.variables import Role

O, C, M, Y = Role.OPTION, Role.CONTEXT, Role.METRIC, Role.OBJECTIVE  # noqa: E741

_SET_BEFORE = "it is set before the mission, so nothing in the mission can cause it"
_MET = "a context is met, not made: nothing in the model causes it"
_NOT_FROM_RESULT = "an objective judges the mission and causes nothing but other objectives"

ALWAYS: Mapping[tuple[Role, Role], str] = {
    (O, O): "options are set independently of each other",
    (M, O): _SET_BEFORE,
    (Y, O): _SET_BEFORE,
    (O, C): _MET,
    (C, C): _MET,
    (M, C): _MET,
    (Y, C): _MET,
    (Y, M): _NOT_FROM_RESULT,
    (O, Y): "an option acts on an objective through metrics (Problem 2.1); what remains is tested apart",
}
_TOO_LATE = "it is settled after the other (declared order)"
RANDOMISED: Mapping[tuple[Role, Role], str] = {
    (C, O): "options were drawn without regard to the context",
}


class Constraints(Record):
    """The rules of one schema, by role."""

    roles: Mapping[str, Role]
    observational: bool = False
    order: Mapping[str, int | None] = field(default_factory=dict)
    """Declared place of each variable in the mission; a later one never causes an earlier one."""

    @classmethod
    def of(cls, schema: Schema) -> Constraints:
        variables = schema.variables.values()
        return cls({v.name: v.role for v in variables}, schema.observational, {v.name: v.order for v in variables})

    def reason(self, cause: str, effect: str) -> str | None:
        """Why the directed edge cannot be, None where it can."""
        pair = (self.roles[cause], self.roles[effect])
        placed, after = self.order.get(cause), self.order.get(effect)
        if pair in ((M, M), (M, Y), (Y, Y)) and placed is not None and after is not None and placed > after:
            return _TOO_LATE
        return ALWAYS.get(pair) or (None if self.observational else RANDOMISED.get(pair))

    def forbids(self, cause: str, effect: str) -> bool:
        """Whether the directed edge cannot be."""
        return self.reason(cause, effect) is not None

    def never_causes(self, a: str, b: str) -> bool:
        """Whether `a` causes `b` neither directly nor through others: an arrowhead at `a` in the partial graph."""
        return self.forbids(a, b) and (self.roles[a], self.roles[b]) != (O, Y)

    def separates(self, a: str, b: str) -> bool:
        """Whether the pair is independent by design, so that no test is needed.

        An option and an objective are not: the option acts through metrics.
        """
        return self.never_causes(a, b) and self.never_causes(b, a)

    def may_explain(self, given: str, name: str) -> bool:
        """Whether conditioning on `given` may take away a dependence of `name`: only what can cause it does.

        Objectives are left out even for other objectives. Time and energy of a mission nearly repeat each other,
        and each would take away every other cause of the other.
        """
        return self.roles[given] is not Y and not self.never_causes(given, name)

    def is_exogenous(self, name: str) -> bool:
        """Whether nothing, seen or hidden, drives the variable together with what follows it.

        True for options drawn at random and for contexts; in an observational table for contexts only.
        """
        return self.roles[name] is C or (self.roles[name] is O and not self.observational)

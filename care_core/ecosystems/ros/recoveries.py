"""Recovery behaviours: what move_base says that it runs, what repairs something in Nav2's behaviour tree."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from care_core.ecosystems.ros.messages import MESSAGES, RECOVERY, TREE, holds
from care_core.logs.base import Table

Recoveries = Sequence[tuple[float, str]]
"""Time and name of each recovery behaviour that ran."""

_REPAIRS = ("spin", "backup", "wait", "driveonheading", "assistedteleop", "clearlocalcostmap", "clearglobalcostmap",
            "clearentirecostmap", "clearcostmap")  # fmt: skip
"""How the names of tree nodes that repair something begin."""


def announced(table: Table) -> Recoveries | None:
    """What move_base tells of each behaviour that it begins; None where the messages are of another kind."""
    if not holds(table, RECOVERY):
        return None
    return tuple((float(t), str(name)) for t, name in zip(table.t, table["recovery_behavior_name"], strict=True))


def repairs(table: Table) -> Recoveries | None:
    """Nodes of a behaviour tree that repair something, each time one leaves IDLE; None as above."""
    if not holds(table, TREE):
        return None
    return tuple(
        (t, name)
        for t, name, before, _ in changes(table)
        if before == "IDLE" and name.replace("_", "").casefold().startswith(_REPAIRS)
    )


def changes(table: Table) -> Iterator[tuple[float, str, str, str]]:
    """Time, node, state before and state after of each change in a behaviour tree."""
    for time_s, *lists in zip(table.t.tolist(), *(table[name] for name in MESSAGES[TREE].reads), strict=True):
        for name, before, after in zip(*lists, strict=True):
            yield time_s, str(name), str(before).upper(), str(after).upper()

"""A vehicle that was not ready to fly and never armed."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import NOT_READY, Finding
from care_core.ecosystems.px4.flight import MESSAGES, STATUS, Px4Flight, is_bare_denial, reason_of
from care_core.ecosystems.px4.preflight import read_by
from care_core.ecosystems.timeline import counted
from care_core.ecosystems.way_back import way_back
from care_core.logs.base import Wanted
from care_core.metadata.causal_map import SET_BY_HAND, meaning_of
from care_core.metadata.firmware import PX4
from care_core.run import Setting, shown

READS: Wanted = {STATUS: ("arming_state",), MESSAGES: ("message",)}
LIMITS = Limits()
_SURE_P = LIMITS.add("probability of what the vehicle says", 0.95, "", "the firmware says itself that this kept it so")
_UNSAID_P = LIMITS.add("probability of a parameter where it says nothing", 0.3, "", "a choice: a part is as likely")
_KEPT_P = LIMITS.add("probability that no mission is flown so", 1.0, "", "it does not arm")

_PLANNED_BY = frozenset(("GF_MAX_HOR_DIST", "GF_MAX_VER_DIST", "MIS_DIST_1WP"))
"""What missions are planned by: a mission beyond it is refused at its default, too; at 0 it refuses none."""


def find(flight: Px4Flight) -> Iterator[Finding]:
    if not flight.complaints or flight.armed:
        return
    reasons = list(dict.fromkeys(reason_of(text) for _, text in flight.refusals))
    first, last = flight.complaints[0][0], flight.complaints[-1][0]
    off = {name: setting for reason in reasons for name in read_by(reason) if (setting := flight.off_default(name))}
    others = "".join(f"{text}; " for text in reasons[-3:-1])
    asked = {name: _value_to_set(one) for name, one in off.items()}
    values = "".join(f"; {_way_back_of(one, asked[name])}" for name, one in off.items())
    named = tuple(off) or tuple(dict.fromkeys(n for reason in reasons for n in _planned_by(flight, reason)))
    is_unsaid = all(is_bare_denial(reason) for reason in reasons)
    yield Finding(
        kind="prearm",
        title=f"{NOT_READY}{reasons[-1]}",
        onset_s=first,
        end_s=max(last, first),
        severity="critical" if flight.was_denied else "warning",
        evidence=f"{others}{counted(len(flight.complaints), 'complaint')}, and it never armed{values}",
        source=f"{MESSAGES} of the preflight checks",
        suspect="parameter" if named or is_unsaid else "operation",
        parameters=named,
        wanted=tuple((name, value) for name, value in asked.items() if value is not None),
        probability=_UNSAID_P if is_unsaid else _SURE_P,
        mission_lost=_KEPT_P,
    )


def _planned_by(flight: Px4Flight, reason: str) -> Iterator[str]:
    """The limits at their defaults that a reason speaks of."""
    return (name for name in read_by(reason) if name in _PLANNED_BY and flight.parameter(name) != 0)


def _value_to_set(one: Setting) -> float | None:
    """The default to put it back to; None for what protects, and for a calibration."""
    meaning = meaning_of(one.name, PX4)
    is_set_by_hand = meaning is not None and meaning.role in SET_BY_HAND
    return float(one.default) if is_set_by_hand and isinstance(one.default, (int, float)) else None


def _way_back_of(one: Setting, asked: float | None) -> str:
    meaning = meaning_of(one.name, PX4)
    back = way_back(one.name, None if meaning is None else meaning.role, asked)
    return f"{one.name} is {shown(one.value)} (default {shown(one.default)}): {back}"


CHECK = Check("arming", "preflight checks that kept it from arming", READS, LIMITS, find)

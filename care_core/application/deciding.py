"""What an operator makes of a diagnosis: changes that are ticked, causes set aside, and what either would bring."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING

from care_core.application.open_run import question_of
from care_core.errors import CareError
from care_core.records import replace

if TYPE_CHECKING:
    from care_core.application.case import Case
    from care_core.diagnose.records import Diagnosis, Fix


def fixes(diagnosis: Diagnosis) -> tuple[Fix, ...]:
    """Every fix that the engine found, the suggested one first."""
    return () if diagnosis.fix is None else (diagnosis.fix, *diagnosis.alternatives)


def decided(diagnosis: Diagnosis, fix: Fix | None, dismissed: Mapping[str, str]) -> Diagnosis:
    """The diagnosis with what the operator made of it: the changes that are ticked, and the causes set aside."""
    from care_core.diagnose.records import Dismissal

    aside = tuple(Dismissal(option, reason) for option, reason in dismissed.items())
    faults = tuple(
        replace(fault, causes=tuple(cause for cause in fault.causes if cause.option.name not in dismissed))
        for fault in diagnosis.faults
    )
    names = [re.compile(rf"\b{re.escape(name)}\b") for name in dismissed]
    tell_more = tuple(one for one in diagnosis.tell_more if not any(name.search(one) for name in names))
    diagnosis = replace(weighed_without(diagnosis, dismissed), faults=faults, tell_more=tell_more)
    if fix is None or not fix.changes:
        return replace(diagnosis, fix=None, alternatives=fixes(diagnosis), dismissed=aside)
    wanted, suggested = changes_of(fix), diagnosis.fix
    others = tuple(other for other in fixes(diagnosis) if changes_of(other) != wanted)
    is_suggested = suggested is not None and changes_of(suggested) == wanted
    why_this = diagnosis.why_this if is_suggested else ""
    return replace(diagnosis, fix=fix, alternatives=others, dismissed=aside, why_this=why_this)


def weighed_without(diagnosis: Diagnosis, dismissed: Collection[str]) -> Diagnosis:
    """The diagnosis with what explains the failure, given that these parameters do not."""
    if diagnosis.failure is None or not dismissed:
        return diagnosis
    from care_core.diagnose.hypotheses import hypotheses_of

    left = diagnosis.failure.without(dismissed)
    return replace(diagnosis, failure=left, hypotheses=hypotheses_of(left))


def changes_of(fix: Fix) -> dict[str, float]:
    """The fix as option to value."""
    return {change.option.name: change.suggested for change in fix.changes}


def predict(case: Case, changes: Mapping[str, float]) -> Fix:
    """These changes with what they would bring; without any, what the same configuration would bring again. What a
    failed part or what the run met explains is taken off, as for the suggestion."""
    from care_core.diagnose.records import Fix

    advised, options = case.diagnosis.fix, {option.name for option in case.options}
    if advised is not None and dict(changes) == changes_of(advised) and (advised.shown_by or changes.keys() - options):
        return advised
    if strange := sorted(changes.keys() - options):
        where = "at another value" if advised is not None and changes.keys() == set(strange) else "beside other changes"
        raise CareError(
            f"What {', '.join(strange)} does {where} is not known: no profile models it.",
            hint="Take the suggestion (s), or untick it.",
        )
    answer = question_of(case).ask(changes)
    predicted = {outlook.objective.variable.name: outlook.predicted for outlook in answer.outlooks}
    by_hand = bool(changes) and all(changes_of(one) != changes for one in fixes(case.diagnosis))
    return Fix(answer.changes, answer.p_ok, predicted, by_hand=by_hand)

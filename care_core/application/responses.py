"""How the odds of a run answer to the value of one parameter."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from care_core.application.open_run import OpenRun, question_of
from care_core.diagnose.records import Odds
from care_core.report.responses import Response
from care_core.variables import Variable


def odds_over(case: OpenRun, option: Variable, beside: Mapping[str, float]) -> Iterator[Odds]:
    """The odds that every objective is met by the value of one option, across its range and beside other changes; none
    where the profile does not model what is changed. Raises CareError where there is no model."""
    modelled = {one.name for one in case.options}
    if option.name not in modelled or beside.keys() - modelled or not option.across(2):
        return
    others = {name: value for name, value in beside.items() if name != option.name}
    yield from question_of(case).odds_over(option.name, others)


def responses_of(case: OpenRun) -> tuple[Response, ...]:
    """That of each parameter that the fix changes, beside its other changes; none where there is no fix."""
    fix = case.diagnosis.fix
    if fix is None or case.reading is None:
        return ()
    values = {change.option.name: change.suggested for change in fix.changes}
    found = []
    for change in fix.changes:
        odds = tuple(odds_over(case, change.option, values))
        reference = case.reading.judged.reference.config.get(change.option.name, change.option.default)
        known = {reference: "reference", change.current: "as driven", change.suggested: "suggested"}
        marks = tuple((value, words) for value, words in known.items() if value is not None)
        if odds:
            found.append(Response(change.option, odds, marks))
    return tuple(found)

"""What no report may say of one run beside something else that it says: each contradiction by a name."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from itertools import pairwise

from care_core.diagnose.estimates import DOUBT
from care_core.diagnose.records import MISSION_FAILED
from care_core.diagnose.verdict import exit_code, status_of
from care_core.errors import ExitCode
from care_core.report.document import CauseEntry, Report
from care_core.report.entries import ConsequenceEntry, FindingEntry
from care_core.text import percent, wrapped

Check = Callable[[Report], bool]
CONTRADICTIONS: dict[str, Check] = {}
_DOWN = ("crash", "takeoff")
_UPSET = ("attitude", "crash", "motor", "takeoff", "thrust")
_ROUNDED, _UNTOLD = 1e-3, 0.06
_REFUSED_CHANGE = re.compile(r"the best found, (\w+) \S+ -> ([^\s,]+)[^,]*, has ([^,]+),")
"""Of a refusal that found one change, and no several."""
_EXIT = {"OK": ExitCode.OK, "FAULT": ExitCode.FAULT, "NOT EVALUATED": ExitCode.NOT_EVALUATED}


def contradictions(report: Report) -> list[str]:
    """The names of those that hold of a report."""
    return [name for name, holds in CONTRADICTIONS.items() if holds(report)]


def _named(name: str) -> Callable[[Check], Check]:
    def register(check: Check) -> Check:
        CONTRADICTIONS[name] = check
        return check

    return register


def _titles(report: Report) -> list[tuple[str, str, str]]:
    """Kind, severity and title of every finding, consequences too."""
    found: list[tuple[str, str, str]] = [(one.kind, one.severity, one.title) for one in report.findings]
    return found + [
        (one.kind, one.severity, one.title)
        for root in report.findings
        for one in (*root.consequences, *root.followed_by)
    ]


def _critical(report: Report) -> list[FindingEntry]:
    return [one for one in report.findings if one.severity == "critical"]


def _objective(report: Report, name: str) -> str:
    return next((one.status for one in report.objectives if one.name == name), "")


def _is_lead(cause: CauseEntry) -> bool:
    return any("not ruled out" in note for note in cause.notes)


def _changed(report: Report) -> list[str]:
    return [] if report.fix is None else [change.option for change in report.fix.changes]


def _crashed(report: Report) -> bool:
    """Whether a crash of a vehicle is told during the mission that is judged."""
    if report.log.format.startswith("ros"):
        return False  # a robot that hit something may reach its goals all the same
    start, end = next(((one.start_s, one.end_s) for one in report.missions if one.judged), (None, None))
    found: list[FindingEntry | ConsequenceEntry] = list(report.findings)
    found += [one for root in report.findings for one in (*root.consequences, *root.followed_by)]
    return any(
        one.kind in _DOWN
        and one.severity == "critical"
        and (start or 0.0) <= (one.onset_s or 0.0) <= (end or 0.0) + 5.0
        for one in found
    )


@_named("it crashed, and no crash or a landing is OK")
def _(report: Report) -> bool:
    return _crashed(report) and "ok" in (_objective(report, "no_crash"), _objective(report, "landed"))


@_named("it crashed, and the mission was accomplished")
def _(report: Report) -> bool:
    return _crashed(report) and _objective(report, "mission_success") == "ok"


@_named("no crash is not met, and it landed")
def _(report: Report) -> bool:
    return _objective(report, "no_crash") == "fault" and _objective(report, "mission_success") == "ok"


@_named("a battery failsafe, and no failsafe acted")
def _(report: Report) -> bool:
    acted = any(title == "battery failsafe" for _, _, title in _titles(report))
    return acted and len(report.missions) < 2 and _objective(report, "no_failsafe") == "ok"


@_named("arming was refused, and it armed")
def _(report: Report) -> bool:
    refused = any(one.kind == "prearm" for one in _critical(report))
    return refused and _objective(report, "armed") == "ok"


@_named("a critical finding, and no FAULT")
def _(report: Report) -> bool:
    return bool(_critical(report)) and report.verdict.status != "fault"


@_named("a FAULT, and nothing that failed")
def _(report: Report) -> bool:
    broken = any(one.status == "fault" for one in report.objectives)
    return report.verdict.status == "fault" and not broken and not _critical(report)


@_named("a FAULT that does not say what failed")
def _(report: Report) -> bool:
    return report.verdict.status == "fault" and report.verdict.failed.endswith(("not met", MISSION_FAILED))


@_named("the status is not that of its objectives and findings")
def _(report: Report) -> bool:
    statuses, severities = {one.status for one in report.objectives}, {one.severity for one in report.findings}
    return report.verdict.status != status_of(statuses, severities, report.fit.verdict)


@_named("the headline's word is not that of the exit code")
def _(report: Report) -> bool:
    code = exit_code(report.verdict.status)
    return _EXIT[report.verdict.word] != code or not report.headline.startswith(report.verdict.word)


@_named("a headline longer than two lines")
def _(report: Report) -> bool:
    return report.verdict.status == "fault" and len(wrapped(report.verdict.headline)) > 2


@_named("a fit longer than two lines")
def _(report: Report) -> bool:
    return len(wrapped(report.verdict.fit)) > 2


@_named("an OK that keeps a failed part to itself")
def _(report: Report) -> bool:
    parts = [
        one.title
        for one in report.findings
        if one.severity != "info" and one.suspect == "hardware" and (one.probability or 0.0) >= 0.5
    ]
    return report.verdict.status == "ok" and bool(parts) and not any(one in report.headline for one in parts)


@_named("nothing failed, and it is explained")
def _(report: Report) -> bool:
    return report.verdict.status != "fault" and bool(report.hypotheses)


@_named("a FAULT that nothing explains")
def _(report: Report) -> bool:
    return report.verdict.status == "fault" and not report.hypotheses


@_named("hypotheses that do not add up to 1, or not in order")
def _(report: Report) -> bool:
    odds = [one.probability for one in report.hypotheses]
    return bool(odds) and (abs(sum(odds) - 1.0) > 1e-3 or odds != sorted(odds, reverse=True))


@_named("a cause that acts less often than it is told")
def _(report: Report) -> bool:
    return any(not one.probability - 1e-6 <= one.acts <= 1.0 for one in report.hypotheses)


@_named("a promise of more than what failed leaves")
def _(report: Report) -> bool:
    parts = [one.acts for one in report.hypotheses if one.what in ("hardware", "world")]
    return _odds(report) > 1.0 - max(parts, default=0.0) + _ROUNDED


@_named("a change that gains more than its parameters explain")
def _(report: Report) -> bool:
    driven = report.odds_as_driven
    acts = {one.name: one.acts for one in report.hypotheses if one.what == "parameter"}
    gained = 0.0 if driven is None else _odds(report) - driven
    # What has no line of its own acts in less than this share of such failures.
    return gained > sum(acts.get(name, _UNTOLD) for name in _changed(report)) + DOUBT.value + _ROUNDED


@_named("a run that failed and is as likely as not to do well as driven, without chance")
def _(report: Report) -> bool:
    chance = sum(one.acts for one in report.hypotheses if one.what == "chance")
    return report.odds_as_driven is not None and report.odds_as_driven > max(0.1, chance) + _ROUNDED


@_named("one cause whose change alone promises more than all of the changes")
def _(report: Report) -> bool:
    alone = [one.p_fixed for fault in report.faults for one in fault.causes if [one.option] == _changed(report)]
    return any(one is not None and abs(one - _odds(report)) > _ROUNDED for one in alone) and _odds(report) > 0.0


@_named("another change, as large, that promises more")
def _(report: Report) -> bool:
    if report.fix is None or report.fix.odds is None:
        return False
    others = [one.p_fixed for one in report.fix.alternatives if len(one.changes) <= len(report.fix.changes)]
    alone = [one.p_fixed for fault in report.faults for one in fault.causes if not _is_lead(one)]
    return any(one is not None and one > _odds(report) + _ROUNDED for one in (*others, *alone))


@_named("a refusal that gives its change other odds than the line of that cause")
def _(report: Report) -> bool:
    told = _REFUSED_CHANGE.search(report.abstained or "")
    if told is None:
        return False
    option, value, odds = told.groups()
    alone = [one for fault in report.faults for one in fault.causes if one.option == option]
    said = [one.p_fixed for one in alone if one.suggested is not None and f"{one.suggested:.4g}" == value]
    return any(share is not None and percent(share) != odds for share in said)


@_named("causes in another order than the explanations")
def _(report: Report) -> bool:
    acts = {one.name: one.acts for one in report.hypotheses if one.what == "parameter"}
    for fault in report.faults:
        found = [one for one in fault.causes if not _is_lead(one)]  # what is only not ruled out comes after them
        told = [acts[one.option] for one in found if one.option in acts]
        if any(later > sooner + 0.02 for sooner, later in pairwise(told)):
            return True
    return False


def _odds(report: Report) -> float:
    """What the change promises, 0 where nothing is promised."""
    return 0.0 if report.fix is None or report.fix.odds is None else report.fix.odds


@_named("an explanation by a finding that the page does not have")
def _(report: Report) -> bool:
    titles = {title for _, _, title in _titles(report)}
    return any(one.what in ("hardware", "world") and one.name and one.name not in titles for one in report.hypotheses)


@_named("a change, and why none is advised")
def _(report: Report) -> bool:
    return report.fix is not None and report.abstained is not None


@_named("a broken objective of a profile, and neither a change nor why none")
def _(report: Report) -> bool:
    return bool(report.faults) and report.fit.verdict != "no" and report.fix is None and not report.abstained


@_named("a refusal that advises a change all the same")
def _(report: Report) -> bool:
    return report.fix is None and any(word in (report.abstained or "") for word in ("bring ", " first to "))


@_named("a change beside a part that explains more")
def _(report: Report) -> bool:
    parameters = sum(one.probability for one in report.hypotheses if one.what == "parameter" and one.name)
    parts = max(
        (one.probability for one in report.hypotheses if one.what in ("hardware", "world") and one.name), default=0.0
    )
    return report.fix is not None and parts > parameters + _ROUNDED


@_named("a change beside a part that surely failed")
def _(report: Report) -> bool:
    return report.fix is not None and any(
        one.suspect == "hardware" and (one.probability or 0.0) >= 0.5 and not one.after_impact
        for one in _critical(report)
    )


@_named("a change of nothing that stands above chance")
def _(report: Report) -> bool:
    chance = sum(one.probability for one in report.hypotheses if one.what == "chance")
    above = {one.name for one in report.hypotheses if one.what == "parameter" and one.probability > chance}
    return report.fix is not None and not above & set(_changed(report))


@_named("a change of what is only not ruled out")
def _(report: Report) -> bool:
    entries = [cause for fault in report.faults for cause in fault.causes if cause.option in _changed(report)]
    leads = {one.option for one in entries if _is_lead(one)}
    return bool(leads - {one.option for one in entries if not _is_lead(one)})


@_named("another change than the first cause's, without why")
def _(report: Report) -> bool:
    first = next((one.name for one in report.hypotheses if one.what == "parameter"), "")
    if report.fix is None or first in _changed(report):
        return False
    return first not in str(report.verdict.advice)


@_named("a promise without the odds as driven")
def _(report: Report) -> bool:
    odds = any(word in str(report.verdict.advice) for word in ("as driven", "odds not measured"))
    return report.fix is not None and not odds


@_named("a promise no better than as driven")
def _(report: Report) -> bool:
    fix, as_driven = report.fix, report.odds_as_driven
    return fix is not None and fix.odds is not None and as_driven is not None and fix.odds < as_driven + 0.1


@_named("a battery failsafe that is lowered for a battery that may not be full")
def _(report: Report) -> bool:
    doubted = any(
        one.kind == "battery" and one.suspect != "parameter" for one in report.findings if one.severity != "info"
    )
    return doubted and "BATT_LOW_VOLT" in _changed(report)


@_named("flown again as it was after it was upset")
def _(report: Report) -> bool:
    upset = any(kind in _UPSET and severity == "critical" for kind, severity, _ in _titles(report))
    as_it_was = (text.removesuffix("then run again") for text in _next(report))  # a simulation, once it is put right
    if any(one.text.startswith("SIM ") or "PX4_SITL" in one.text for one in report.account):  # so is one once changed
        as_it_was = (text for text in as_it_was if not text.startswith(("make the change, run again", "put all ")))
    return upset and any("run again" in text or "run the same" in text for text in as_it_was)


def _next(report: Report) -> Iterator[str]:
    yield report.next_step
    yield from report.tell_more


@_named("the mission's row says otherwise")
def _(report: Report) -> bool:
    row = next((one for one in report.missions if one.judged), None)
    broken = any(one.status == "fault" for one in report.objectives)
    return row is not None and (row.status == "fault") != broken


@_named("the mission's row calls OK what the report does not evaluate, or the other way round")
def _(report: Report) -> bool:
    row = next((one for one in report.missions if one.judged), None)
    verdict = report.verdict.status
    return row is not None and "fault" not in (row.status, verdict) and row.status != verdict

"""How a run shows that it failed, in the words of the causal map: what each parameter is held against."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence

from care_core.causal.counterfactual import CounterfactualQuery
from care_core.causal.mechanisms import columns
from care_core.diagnose.records import ObjectiveResult
from care_core.ecosystems.findings import NOT_READY, Event, Finding, FindingKind, Health, every_finding
from care_core.ecosystems.vehicles import vehicle_of_run
from care_core.metadata.causal_map import Sign
from care_core.metadata.screening import plain_refusal
from care_core.profile.schema import Schema
from care_core.records import Record
from care_core.run import Run, is_known

OF_KIND: Mapping[FindingKind, Sign] = {
    "prearm": "refused", "takeoff": "tipped", "crash": "upset", "attitude": "upset", "motor": "upset",
    "thrust": "thrust", "tuning": "oscillates", "compass": "heading", "gps": "position", "barometer": "height",
    "surface": "upset", "airspeed": "height", "estimator": "estimator", "imu": "vibration", "vibration": "vibration",
    "cpu": "loop", "blocked": "stuck",
}  # fmt: skip
_OF_TITLE: tuple[tuple[re.Pattern[str], Sign], ...] = (
    (re.compile(r"oscillates"), "oscillates"),
    (re.compile(r"waits to be set off"), "stuck"),
    (
        re.compile(
            r"^it (drives|turns) against|drives where|runs away|trim of the .* not (its|their) middle|TURN_RADIUS"
        ),
        "strays",
    ),
    (re.compile(r"an output ends before|it stands before"), "stuck"),
    (re.compile(r"heading does not follow"), "heading"),
    (re.compile(r"far above its mission"), "height"),
    (re.compile(r"battery failsafe|partly charged|battery sags"), "failsafe_battery"),
    (re.compile(r"ground station"), "failsafe_gcs"),
    (re.compile(r"radio|throttle failsafe"), "failsafe_radio"),
)
_OF_EVENT: tuple[tuple[re.Pattern[str], Sign], ...] = (
    (re.compile(r"fence", re.IGNORECASE), "failsafe_fence"),
    (re.compile(r"terrain", re.IGNORECASE), "failsafe_terrain"),
    (re.compile(r"batt.*failsafe|failsafe.*batt|battery .* is (low|critical)", re.IGNORECASE), "failsafe_battery"),
    (re.compile(r"gcs failsafe|ground station failsafe", re.IGNORECASE), "failsafe_gcs"),
    (re.compile(r"(radio|throttle|rc) failsafe", re.IGNORECASE), "failsafe_radio"),
    (re.compile(r"(ekf|dead ?reckon).*failsafe|ekf variance", re.IGNORECASE), "failsafe_estimator"),
    (re.compile(r"thrust loss", re.IGNORECASE), "thrust"),
)
"""What the firmware says itself. A failsafe is the reason of what follows."""
_PHASES: Mapping[str, Sign] = {
    "takeoff": "slow_takeoff", "return": "slow_rtl", "descent": "slow_rtl", "touchdown": "slow_land",
}  # fmt: skip
"""Of the phases that the metrics measure."""
LONGER_S = 5.0
"""Seconds by which a phase has to exceed what the configuration as driven gives."""
_SHARE = 0.3
"""Share of all that was too long from which a phase counts."""


_EXPLAINS = re.compile(r"[A-Z][A-Z0-9]*_[A-Z0-9_]+ is -?\d")
"""What the evidence of a refusal adds of the parameters that its check reads."""


class Signs(Record):
    """How a run shows that it failed. `first` are the ones that came first or that the firmware itself names; the rest
    may follow from these."""

    first: frozenset[Sign]
    every: frozenset[Sign]
    refusals: frozenset[str] = frozenset()
    """What kept it from arming, without its numbers."""


def signs_of(
    run: Run,
    broken: Sequence[ObjectiveResult],
    health: Health,
    schema: Schema | None = None,
    query: CounterfactualQuery | None = None,
) -> Signs:
    """The signs of a failed run.

    Args:
        broken: the objectives that it missed.
        query: what its configuration is expected to do, by the profile `schema`; None where no model can be asked.
    """
    found = list(_of_findings(health.findings))
    every = set(_of_every_finding(health.findings))
    told = [sign for event in health.timeline if _counts(event) for sign in _of_text(event.text)]
    flies = vehicle_of_run(run).kind != "rover"
    short = list(_of_shortfall(run.shortfall, flies))
    missed = [sign for result in broken for sign in _of_objective(result, run, schema, query)]
    every |= {*found, *told, *short, *missed}
    if refusals := _refusals(health.findings):
        return Signs(frozenset(("refused",)), frozenset(every), refusals)
    failsafes = [sign for sign in told if sign.startswith("failsafe")]
    first = found[:1] or failsafes[:1] or [*short[:1], *missed]
    return Signs(frozenset((*first, *failsafes[:1])), frozenset(every))


def _refusals(findings: Iterable[Finding]) -> frozenset[str]:
    refused = [one for one in every_finding(findings) if one.kind == "prearm" and one.severity != "info"]
    return frozenset(plain_refusal(text) for one in refused for text in _refusal_texts(one))


def _refusal_texts(refusal: Finding) -> Iterator[str]:
    """The words of the checks that refused: of PX4, which complains of much until it is ready, the last ones."""
    if refusal.title.startswith(NOT_READY):
        yield refusal.title.removeprefix(NOT_READY)
    else:
        yield from (text for text in refusal.evidence.split("; ") if not _EXPLAINS.match(text))


def _of_findings(findings: Iterable[Finding]) -> Iterator[Sign]:
    """Of the critical ones that begin a course of events, in the order told."""
    for finding in findings:
        if finding.severity == "critical" and not finding.after_impact:
            yield from _of_finding(finding)


def _of_every_finding(findings: Iterable[Finding]) -> Iterator[Sign]:
    for finding in every_finding(findings):
        if finding.severity != "info" and not finding.after_impact:
            yield from _of_finding(finding)


def _of_finding(finding: Finding) -> Iterator[Sign]:
    named = [sign for pattern, sign in _OF_TITLE if pattern.search(finding.title)]
    if named:
        yield from named
    elif finding.kind in OF_KIND:
        yield OF_KIND[finding.kind]


def _counts(event: Event) -> bool:
    return event.kind in ("failsafe", "error", "crash")


def _of_text(text: str) -> Iterator[Sign]:
    return (sign for pattern, sign in _OF_EVENT if pattern.search(text))


def _of_shortfall(shortfall: Iterable[str], flies: bool) -> Iterator[Sign]:
    for text in shortfall:
        if text.startswith("it came down"):
            yield "elsewhere"
        elif re.match(r"0 of \d+ (waypoints|mission items)", text):
            yield from ("no_takeoff", "stuck") if flies else ("stuck",)
        elif re.search(r"(waypoints|mission items) were reached", text):
            yield "stuck"


def _of_objective(
    result: ObjectiveResult, run: Run, schema: Schema | None, query: CounterfactualQuery | None
) -> Iterator[Sign]:
    name = result.variable.name
    if "path" in name:
        yield "strays"
    elif "energy" in name:
        yield "costly"
    elif "time" in name:
        if schema is None or query is None:
            yield "slow_cruise"
        else:
            yield from _slow(run, schema, query)


def _slow(run: Run, schema: Schema, query: CounterfactualQuery) -> Iterator[Sign]:
    """The phases that took longer than the configuration as driven explains. A drive has no phases but the way."""
    longer: dict[Sign, float] = {}
    for metric in schema.metrics:
        how = metric.extract
        if how is None or not how.kind.endswith("phase_time") or how.args.get("phase") not in _PHASES:
            continue
        sign, seconds = _PHASES[how.args["phase"]], _excess(metric.name, run, query)
        longer[sign] = longer.get(sign, 0.0) + max(0.0, seconds)
    if not longer:
        yield "slow_cruise"
    whole = sum(longer.values())
    yield from (sign for sign, seconds in longer.items() if seconds >= max(LONGER_S, _SHARE * whole))


def _excess(metric: str, run: Run, query: CounterfactualQuery) -> float:
    seen, mechanism = run.metrics.get(metric), query.model.mechanisms.get(metric)
    if mechanism is None or not is_known(seen):
        return 0.0
    return float(seen) - float(mechanism.expected(columns([query.config], mechanism.inputs))[0])

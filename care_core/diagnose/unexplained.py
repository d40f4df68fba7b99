"""Why no option of the profile is blamed for what a run missed, where that is known before any is weighed."""

from __future__ import annotations

from care_core.diagnose.failed_run import FailedRun
from care_core.diagnose.records import ObjectiveResult
from care_core.ecosystems.findings import Health, every_finding
from care_core.run import is_known
from care_core.text import listed
from care_core.variables import Variable


def refused_otherwise(failed: FailedRun, health: Health) -> str | None:
    """Said where the run ended at a refusal to arm that speaks of no option of the profile: for what an operator has to
    do, or for none of the complaints that the profile tells apart. What options do in flight is no cause of it."""
    said = next((one for one in every_finding(health.findings) if one.kind == "prearm"), None)
    if said is None or failed.run.refused_by:
        return None
    if said.parameters:
        read = listed(said.parameters)
        return f"{said.title}: that check reads {read}; look there first"
    if said.suspect == "operation":
        return f"{said.title}: that check reads no parameter of the profile, so none explains it"
    complaints = [one for one in failed.profile.schema.metrics if _is_of_one_complaint(one)]
    if not complaints or any(failed.run.metrics.get(one.name) == 1 for one in complaints):
        return None
    return f"{said.title}: that complaint speaks of no parameter of the profile, so none is blamed"


def _is_of_one_complaint(metric: Variable) -> bool:
    how = metric.extract
    return how is not None and how.kind == "arming_refused" and bool(how.args)


def out_of_reach(failed: FailedRun, result: ObjectiveResult) -> str | None:
    """Said of what no training run came near, a threshold or a way to fail: no option can be blamed for it."""
    if result.variable.kind == "functional":
        return _new_way_to_fail(failed)
    name, bound = result.variable.name, result.threshold
    summary = failed.query.model.summary_at(name, failed.query.reference)
    if bound is None or summary is None:
        return None
    best = summary.low if bound.op in ("<=", "<") else summary.high
    if bound.op == "==" or bound.met(best):
        return None
    unit = f" {result.variable.unit}" if result.variable.unit else ""
    nearest = f"the best: {best:g}{unit}"
    return f"no run of the profile's training met {name} {bound}{unit} ({nearest}): no parameter explains it"


def _new_way_to_fail(failed: FailedRun) -> str | None:
    for variable in failed.profile.schema.metrics:
        summary, value = failed.query.model.summaries.get(variable.name), failed.run.metrics.get(variable.name)
        if variable.type != "bool" or summary is None or not is_known(value):
            continue
        if summary.low == summary.high != value:
            what = variable.doc or f"{variable.name} is {value:g}"
            return f"{what}, as in no training mission of the profile: it knows nothing of what leads to that"
    return None

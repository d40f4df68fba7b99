"""A mission of a QuadPlane that took too long: hardly a resample finds the cause, physics has it."""

from __future__ import annotations

import care_core
from care_core.files import bundled


def test_circles_that_are_too_wide_are_the_cause_by_physics_and_their_radius_is_advised() -> None:
    diagnosis = care_core.triage(bundled("samples", "quadplane_failed.BIN")).diagnosis
    assert diagnosis.profile.name == "quadplane"
    first = diagnosis.hypotheses[0]
    assert (first.what, first.name) == ("parameter", "WP_LOITER_RAD")
    assert diagnosis.fix is not None
    (change,) = diagnosis.fix.changes
    assert (change.option.name, change.current, change.suggested) == ("WP_LOITER_RAD", 249.0, 60.0)
    assert {fault.causes[0].option.name for fault in diagnosis.faults} == {"WP_LOITER_RAD"}
    cause = next(fault.causes[0] for fault in diagnosis.faults if fault.objective.variable.name == "mission_time")
    assert [node.name for node in cause.path] == ["WP_LOITER_RAD", "mission_time"]
    assert cause.path[0].support is None, "no resample is asked about physics"
    assert not any("resamples" in note.text or "seen in training" in note.text for note in cause.notes)
    assert cause.p_fixed == diagnosis.fix.p_fixed

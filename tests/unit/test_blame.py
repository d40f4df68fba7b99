"""Which options may have broken a run: those that could act in it."""

from __future__ import annotations

import pytest

from care_core.diagnose.blame import blame
from care_core.diagnose.judging import query_of, read_and_judge
from care_core.ecosystems.examine import examine
from care_core.ecosystems.registry import run_model
from care_core.files import bundled
from care_core.logs.opening import open_log
from care_core.profile.store import load_profile
from care_core.records import replace


@pytest.mark.parametrize(("refused", "acts"), [(0.0, False), (1.0, True)], ids=["it armed", "it was refused"])
def test_what_only_keeps_a_vehicle_from_arming_explains_nothing_of_one_that_armed(refused: float, acts: bool) -> None:
    profile = load_profile(bundled("profiles", "px4"))
    model = run_model(open_log(bundled("samples", "px4_failed.ulg")))
    judged = read_and_judge(model, profile)
    run = judged.run
    config, metrics = {**run.config, "MIS_DIST_1WP": 8.0}, {**run.metrics, "arming_refused": refused}
    judged = replace(judged, run=replace(run, config=config, metrics=metrics))
    failure = blame(judged, profile, query_of(judged, profile), examine(model)).failure
    assert (failure.loses["parameter", "MIS_DIST_1WP"] > 0.0) == acts
    assert failure.loses["parameter", "NAV_ACC_RAD"] > 0.2

"""Options that are chosen for an airframe: a firmware's default is no reference for them."""

from __future__ import annotations

from care_core.application.case import Request, open_case
from care_core.diagnose.reference import Good, reference_of
from care_core.files import bundled
from care_core.profile.store import load_profile
from care_core.records import replace

SAMPLE = bundled("samples", "arduplane_failed.BIN")


def test_a_plane_with_the_defaults_of_a_firmware_is_judged_with_its_own_gains() -> None:
    case = open_case(Request(SAMPLE), lambda _step, _share: None)
    run, profile = case.diagnosis.run, load_profile("arduplane")
    schema, model = profile.schema, profile.model
    tuned = replace(run.settings["RLL_RATE_P"], value=0.2, default=0.08)
    limits = replace(run.settings["THR_MAX"], value=60.0, default=75.0)
    own = replace(
        run,
        settings={**run.settings, "RLL_RATE_P": tuned, "THR_MAX": limits},
        config={**run.config, "RLL_RATE_P": 0.2, "THR_MAX": 60.0},
    )
    found = reference_of(own, schema, model).config
    assert found["RLL_RATE_P"] == 0.2  # chosen for the airframe
    assert found["THR_MAX"] == 75.0  # a limit that anybody may set
    good = Good({"RLL_RATE_P": replace(tuned, value=0.3)}, "good.BIN")
    assert reference_of(own, schema, model, good).config["RLL_RATE_P"] == 0.3


def test_the_defaults_of_the_profile_itself_are_a_reference() -> None:
    case = open_case(Request(SAMPLE), lambda _step, _share: None)
    run, profile = case.diagnosis.run, load_profile("arduplane")
    assert run.config["TECS_CLMB_MAX"] < 1.0
    assert reference_of(run, profile.schema, profile.model).config["TECS_CLMB_MAX"] == 5.0

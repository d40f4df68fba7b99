"""Two missions of PX4 as an operator would ask about them: a parameter that is off, and a motor that gave way."""

from __future__ import annotations

import json
from typing import Any

from care_core.application.case import Request, open_case
from care_core.application.proof import proof_of
from care_core.files import bundled
from tests.conftest import Care


def triaged(care: Care, name: str) -> tuple[int, dict[str, Any]]:
    found = care("triage", bundled("samples", name), "--json")
    return found.code, json.loads(found.stdout)


def test_a_radius_that_cuts_corners_is_the_cause_and_its_value_is_advised(care: Care) -> None:
    code, found = triaged(care, "px4_failed.ulg")
    assert code == 1
    assert found["hypotheses"][0]["name"] == "NAV_ACC_RAD"
    (change,) = found["fix"]["changes"]
    assert change["option"] == "NAV_ACC_RAD"
    assert change["from"] > 11.0 > 4.0 > change["to"]
    assert found["findings"] == []


def test_a_motor_that_gave_way_is_no_parameter(care: Care) -> None:
    code, found = triaged(care, "px4_motor.ulg")
    assert code == 1
    assert found["findings"][0]["title"] == "motor 4 (rear right) gave too little thrust"
    assert found["hypotheses"][0]["what"] == "hardware"
    assert not (found["fix"] or {}).get("changes")


def test_what_leads_off_the_way_is_shown_along_the_ground() -> None:
    path = bundled("samples", "px4_failed.ulg")
    case = open_case(Request(path), lambda *_: None)
    cause = case.diagnosis.faults[0].causes[0]
    assert proof_of(case, cause).signals[0].field == "x"

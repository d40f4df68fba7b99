"""A QuadPlane that is not armed because its last leg is shorter than it needs to stop in."""

from __future__ import annotations

from care_core.ecosystems.registry import run_model
from care_core.extract.read import read_run
from care_core.profile.store import load_profile
from tests.planes import MadePlane
from tests.tables import TablesLog

SCHEMA = load_profile("quadplane").schema
SAYS = "PreArm: VTOL land too short, min 484m"


def refused_by(**settings: float) -> frozenset[str]:
    flown = MadePlane()
    flown.settings |= {"Q_ENABLE": 1, "Q_TRANS_DECEL": 2, "AIRSPEED_CRUISE": 25, **settings}
    flown.rows["MSG"] = [(5.0, {"Message": SAYS}), (35.0, {"Message": SAYS})]
    del flown.rows["ARM"]
    for column in flown.table.values():
        if "Spd" in column:
            column["Spd"][:] = 0.0
    log = TablesLog(flown.tables(), float(flown.t[-1]), facts=flown.facts, known=flown.known)
    return read_run(run_model(log), SCHEMA, sha256=lambda: "0" * 64).refused_by


def test_too_soft_a_deceleration_is_what_refuses_it() -> None:
    assert refused_by(Q_TRANS_DECEL=0.484) == {"Q_TRANS_DECEL"}


def test_too_fast_a_cruise_is_what_refuses_it() -> None:
    assert refused_by(AIRSPEED_CRUISE=30) == {"AIRSPEED_CRUISE"}


def test_a_mission_that_is_short_is_no_parameter_s_fault() -> None:
    assert refused_by() == frozenset()

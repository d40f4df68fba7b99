"""Which signal shows a finding or a cause, for the app and for pages alike."""

from __future__ import annotations

import math

import numpy as np
import pytest

import care_core
from care_core.application.case import Case
from care_core.application.deciding import weighed_without
from care_core.application.plotting import drawn_of, ranked
from care_core.application.proof import Proof, proof_of
from care_core.application.signals import settled_s, trace_of, whole_of
from care_core.application.track import way_of
from care_core.diagnose.hypotheses import hypotheses_of
from care_core.diagnose.noisy_or import CHANCE, NoisyOr
from care_core.ecosystems.findings import Event, Finding, Health, every_finding
from care_core.errors import CareError
from care_core.files import bundled
from care_core.records import replace
from care_core.report.axes import tick_time, time_ticks, value_ticks
from tests.made import MadeLog, T
from tests.tui import sample_diagnosis as sample


@pytest.fixture(scope="module")
def motor() -> Case:
    return care_core.triage(bundled("samples", "arducopter_motor.BIN"))


def first(case: Case, title: str) -> str:
    finding = next(one for one in every_finding(case.diagnosis.health.findings) if title in one.title)
    return proof_of(case, finding).signals[0].name


def test_a_motor_is_shown_beside_another_around_the_time_it_failed(motor: Case) -> None:
    finding = next(one for one in every_finding(motor.diagnosis.health.findings) if "motor 4" in one.title)
    proof = proof_of(motor, finding)
    signal, (start_s, end_s) = proof.signals[0], proof.around(whole_of(motor))
    assert (signal.name, signal.wanted, signal.is_beside) == ("RCOU C4", ("RCOU", "C1"), True)
    assert (start_s, end_s) == pytest.approx((46.0, 108.6), abs=1.0)
    assert trace_of(motor, signal, (start_s, end_s), 40).wanted
    assert Proof(()).around((10.0, 20.0)) == (10.0, 20.0)
    assert Proof((), 11.0, 19.0).around((10.0, 20.0)) == (10.0, 20.0)


def test_what_is_measured_on_the_way_is_shown_by_the_way() -> None:
    case = care_core.triage(bundled("samples", "px4_failed.ulg"))
    shown = {one.name: proof_of(case, one).is_way for one in case.diagnosis.objectives}
    assert shown == {"mission_success": True, "mission_time": False, "energy": False, "path_error_max": True}
    assert proof_of(case, case.diagnosis.faults[0].causes[0]).is_way


@pytest.mark.parametrize(
    ("title", "signal"),
    [
        ("motor 4", "RCOU C4"),
        ("too little thrust", "CTUN ThO"),
        ("heading", "ATT Yaw"),
        ("came down", "CTUN Alt"),
        ("battery", "BAT Volt"),
    ],
)
def test_a_finding_is_shown_by_the_signal_that_it_speaks_of(motor: Case, title: str, signal: str) -> None:
    assert first(motor, title) == signal


def test_an_axis_that_oscillates_is_shown_by_its_rate_and_not_by_its_angle() -> None:
    log = MadeLog({"ATT": {"Roll": T, "DesRoll": T}, "RATE": {"P": T, "PDes": T, "R": T, "RDes": T}})
    finding = Finding("tuning", "the roll rate swings around its target", 1.0, 9.0, "warning", "", "RATE; limit 30")
    case = Case(replace(sample.unfitting(), health=Health("", (), (finding,))), log=log)
    proof = proof_of(case, finding)
    assert proof.signals[0].name == "RATE R"
    assert (proof.start_s, proof.end_s) == (1.0, 9.0)
    assert ranked(case)[0][0][0].channel == "RATE", "the page draws it first, too"


def test_a_cause_is_shown_by_what_its_first_step_is_read_from() -> None:
    case = care_core.triage(bundled("samples", "arducopter_failed.BIN"))
    cause = case.diagnosis.faults[0].causes[0]
    assert proof_of(case, cause).signals[0].name == "POS RelHomeAlt"
    assert proof_of(case, case.diagnosis.faults[0].objective).signals, "an objective has signals as well"


def test_what_comes_after_the_landing_sets_no_scale_in_app_and_page(motor: Case) -> None:
    thrown = np.where(T <= 50, 1.0, 99.0)
    landed = Health("", (Event(50.0, "flight", "landed", "EV"),), ())
    case = Case(replace(sample.unfitting(), health=landed), log=MadeLog({"ATT": {"Roll": thrown}}))
    signal = proof_of(case, Finding("attitude", "roll", 0.0, 1.0, "warning", "", "ATT")).signals[0]
    assert trace_of(case, signal, (0.0, 100.0), 10).high == 1.0
    assert drawn_of(motor).scale_end_s == settled_s(motor.diagnosis) < math.inf
    assert settled_s(sample.all_ok()) == math.inf


def test_the_axis_of_a_page_counts_the_seconds_of_the_log(motor: Case) -> None:
    drawn = drawn_of(motor)
    assert drawn.since == "the start of the log"
    assert "74.7 s</span>" in motor.report("html"), "a mark has the time that the finding has"
    assert time_ticks(drawn.start_s, drawn.end_s, 7) == (60.0, 120.0, 180.0, 240.0, 300.0)
    assert [tick_time(one) for one in (0.5, 590.0, 725.0)] == ["0.5", "590", "12:05"]
    assert value_ticks(-1.0, 1.0, 4) == (-1.0, -0.5, 0.0, 0.5, 1.0)


def test_the_way_is_in_metres_with_the_corners_that_were_asked_for() -> None:
    case = care_core.triage(bundled("samples", "arducopter_failed.BIN"))
    way = way_of(case)
    assert len(way.track) == len(way.times_s) > 100
    assert way.legs[0] == (0.0, 0.0)
    assert way.legs[2] == pytest.approx((59.9, 45.0), abs=0.5)
    px4 = way_of(care_core.triage(bundled("samples", "px4_failed.ulg")))
    assert len(px4.legs) > 3, "home and the waypoints"
    assert min(math.dist(px4.legs[1], point) for point in px4.track) < 15
    drive = way_of(care_core.triage(bundled("samples", "move_base_drive.bag")))
    assert [round(east) for east, _ in drive.legs] == [4, 7, 9, 12, 15]
    nav2 = way_of(care_core.triage(bundled("samples", "nav2_mppi_failed.mcap")))
    assert [(round(east), round(north)) for east, north in nav2.legs] == [(5, 7), (2, 2)], "ends of plans"
    assert math.dist(nav2.legs[-1], nav2.track[-1]) == pytest.approx(0.3, abs=0.1), "it stopped short of the last"
    with pytest.raises(CareError, match="does not say where"):
        way_of(Case(sample.unfitting(), log=MadeLog({"ATT": {"Roll": T}})))


def test_a_cause_set_aside_has_the_others_weighed_anew() -> None:
    causes = NoisyOr({("parameter", "A"): 0.9, ("parameter", "B"): 0.6, CHANCE: 0.1})
    weighed = replace(sample.faulty(), failure=causes, hypotheses=hypotheses_of(causes))
    assert [one.name for one in weighed.hypotheses][:2] == ["A", "B"]
    left = weighed_without(weighed, {"A"}).hypotheses
    assert left[0].name == "B"
    assert left[0].acts > 5 * weighed.hypotheses[1].probability
    assert sum(one.probability for one in left) == pytest.approx(1.0)
    assert weighed_without(weighed, ()) == weighed
    assert weighed_without(sample.faulty(), {"A"}) == sample.faulty()


def test_whether_a_goal_was_reached_is_shown_by_the_way_left_to_it() -> None:
    case = care_core.triage(bundled("samples", "nav2_failed.mcap"))
    success = next(one for one in case.diagnosis.objectives if one.variable.name == "mission_success")
    halted = next(one for one in every_finding(case.diagnosis.health.findings) if "no progress" in one.title)
    for subject in (success, halted):
        assert proof_of(case, subject).signals[0].field == "feedback.distance_remaining"

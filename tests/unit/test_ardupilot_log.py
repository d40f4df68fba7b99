"""Holes in a log, and how it ends."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.ecosystems.ardupilot.examining import find
from care_core.ecosystems.findings import every_finding
from tests.flights import ARMED_S, DOWN_S, END_S, JUMP, Made, flight_of


def test_a_log_that_ends_in_the_air_and_one_with_a_hole() -> None:
    made = Made()
    made.rows["ARM"].pop()
    tables = {name: table.between(0.0, 70.0) for name, table in made.tables().items()}
    flight = made.flight()
    (finding,) = find(flight_of(tables, flight.settings, flight.log.facts, 70.0))
    assert (finding.kind, finding.title, finding.severity) == ("log", "the log ends in the air", "warning")
    made.table["POWR"]["Vcc"][made.after(69.5)] = 4.5
    tables = {name: table.between(0.0, 70.0) for name, table in made.tables().items()}
    finding = find(flight_of(tables, flight.settings, flight.log.facts, 70.0))[0]
    assert (finding.kind, finding.title) == ("battery", "power was lost in the air")
    holed = {name: table.where((table.t < 40) | (table.t > 48)) for name, table in Made().tables().items()}
    (finding,) = find(flight_of(holed, flight.settings, flight.log.facts, END_S))
    assert finding.title == "the log has 1 hole"
    assert find(flight_of(holed, flight.settings, flight.log.facts, END_S, [JUMP])) == ()  # not by such a clock


@pytest.mark.parametrize(("sinks_ms", "titles"), [(12.0, ["the log ends in the air"]), (2.0, [])])
def test_a_log_that_ends_in_a_fall_below_its_home(sinks_ms: float, titles: list[str]) -> None:
    made = Made()
    made.rows["ARM"].pop()
    falls = made.after(60.0)
    made.table["CTUN"]["ThO"][falls] = 0.0
    for name, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt"), ("CTUN", "BAlt"), ("CTUN", "DAlt"), ("BARO", "Alt"),
                        ("BARO#2", "Alt"), ("GPS", "Alt")):  # fmt: skip
        made.table[name][field][falls] -= sinks_ms * (made.t[falls] - 60.0)
    tables = {name: table.between(0.0, 70.0) for name, table in made.tables().items()}
    findings = every_finding(find(flight_of(tables, made.known, made.facts, 70.0)))
    assert [one.title for one in findings if one.kind == "log"] == titles


def test_a_log_ends_on_the_ground_by_the_barometer_whatever_the_estimate_says() -> None:
    made = Made()
    made.rows["ARM"].pop()
    for name in ("BARO", "BARO#2"):
        made.table[name]["Alt"][made.after(60.0)] = 0.0
    made.table["CTUN"]["BAlt"][made.after(60.0)] = 0.0
    tables = {name: table.between(0.0, 70.0) for name, table in made.tables().items()}
    findings = every_finding(find(flight_of(tables, made.known, made.facts, 70.0)))
    assert "the log ends in the air" not in [one.title for one in findings]


def test_a_log_that_is_written_while_armed_only_tells_of_no_arming() -> None:
    made = Made()
    del made.rows["ARM"], made.rows["MSG"]
    made.table["CTUN"]["ThO"][:] = 0.0
    assert made.flight().armed == ()
    made.settings["LOG_DISARMED"] = 0
    assert made.flight().armed == ((0.0, END_S),)
    outputs = {name: made.table["RCOU"][name].copy() for name in ("C1", "C2", "C3", "C4")}
    for name in outputs:
        made.table["RCOU"][name][:] = 1000.0
    assert made.flight().armed == ()  # a log was forced open on the ground
    made.table["RCOU"].update(outputs)
    made.rows["MSG"] = [(5.0, {"Message": "PreArm: Need 3D Fix"})]  # a refusal opens a log as well
    assert made.flight().armed == ()


def test_a_log_whose_last_record_is_the_disarming_does_not_end_in_the_air() -> None:
    made = Made()
    made.rows["ARM"][-1] = (70.0, {"ArmState": 0.0, "Forced": 0.0})
    tables = {name: table.between(0.0, 70.0) for name, table in made.tables().items()}
    flight = made.flight()
    assert find(flight_of(tables, flight.settings, flight.log.facts, 70.0)) == ()


def test_what_is_not_recorded_between_two_flights_is_no_hole() -> None:
    made = Made()
    made.rows["ARM"] += [(40.0, {"ArmState": 0.0, "Forced": 0.0}), (60.0, {"ArmState": 1.0, "Forced": 0.0})]
    tables = {name: table.where((table.t <= 40.2) | (table.t >= 59.9)) for name, table in made.tables().items()}
    flight = made.flight()
    assert not [one for one in find(flight_of(tables, flight.settings, flight.log.facts, END_S)) if one.kind == "log"]


def test_a_logger_that_is_opened_by_the_arming_tells_of_it_in_words_alone() -> None:
    made = Made()
    made.rows["ARM"] = [(DOWN_S + 5, {"ArmState": 0.0, "Forced": 0.0})]
    made.rows["MSG"] = [(2.0, {"Message": "Arm: Need Position Estimate"}), (40.0, {"Message": "Arming motors"})]
    tables = {name: table.where((table.t < 20.0) | (table.t >= 39.9)) for name, table in made.tables().items()}
    flight = flight_of(tables, made.flight().settings, made.facts, END_S)
    assert flight.armed == ((40.0, DOWN_S + 5),)
    assert not [one for one in find(flight) if one.kind in ("log", "prearm")]  # it was closed, and then it did arm


def test_what_is_armed_once_more_was_disarmed_while_nothing_was_recorded() -> None:
    made = Made()
    made.rows["ARM"].insert(1, (60.0, {"ArmState": 1.0, "Forced": 0.0}))
    whole = made.flight()
    assert whole.armed == ((ARMED_S, 60.0), (60.0, DOWN_S + 5))
    tables = {name: table.where((table.t < 40.0) | (table.t >= 59.9)) for name, table in made.tables().items()}
    flight = flight_of(tables, whole.settings, whole.log.facts, END_S)
    assert np.ravel(flight.armed).tolist() == pytest.approx([ARMED_S, 39.9, 60.0, DOWN_S + 5])
    assert not [one for one in find(flight) if one.kind == "log"]

"""Radio, estimator, fence, computer, leaks, and parameters that were changed in the air."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from care_core.ecosystems.ardupilot.examining import find
from care_core.ecosystems.ardupilot.texts import code_of
from care_core.ecosystems.findings import every_finding
from care_core.ecosystems.vehicles.errors import EKF_CHECK, GPS
from care_core.run import Setting
from tests.flights import ARMED_S, DOWN_S, END_S, FAILS_S, HEIGHT_M, Made, first, flight_of


def leaks(firmware: str, code: float = 0.0, message: str = "", pins: Sequence[float] = ()) -> list[float | None]:
    """When water is told of in a dive whose log says these at 60 s; the pins are those of its detectors."""
    dive = Made()
    dive.settings |= {f"LEAK{number}_PIN": pin for number, pin in enumerate(pins, start=1)}
    dive.facts = {"firmware": firmware}
    dive.rows["ERR"] = [(60.0, {"Subsys": 27.0, "ECode": code})]
    dive.rows["MSG"] = [(60.0, {"Message": message})]
    found = [one for one in every_finding(dive.find()) if one.kind == "leak"]
    assert all(one.severity == "critical" for one in found)
    return [one.onset_s for one in found]


def test_a_fence_is_held_against_what_was_asked_before_it_acted() -> None:
    made = Made()
    made.settings |= {"FENCE_ALT_MAX": HEIGHT_M + 2.0, "RTL_ALT": 9000}
    made.rows["MODE"] = [(0.0, {"ModeNum": 3.0}), (50.0, {"ModeNum": 6.0})]
    made.rows["ERR"] = [(50.0, {"Subsys": 9.0, "ECode": 1.0})]
    made.table["CTUN"]["DAlt"][made.t >= 50.0] = 90.0
    assert "it was sent across its fence" not in [one.title for one in made.find()]
    made.table["CTUN"]["DAlt"][made.t >= 45.0] = 90.0
    assert "it was sent across its fence" in [one.title for one in made.find()]


@pytest.mark.parametrize("is_cleared", [True, False])
def test_an_estimator_check_that_fails_on_the_ground_and_is_never_cleared_is_told(is_cleared: bool) -> None:
    made = Made()
    made.rows["ERR"] = [(ARMED_S + 1.0, {"Subsys": 16.0, "ECode": 2.0})]
    if is_cleared:
        made.rows["ERR"].append((ARMED_S + 2.0, {"Subsys": 16.0, "ECode": 0.0}))
    found = [one for one in every_finding(made.find()) if one.kind == "estimator"]
    assert [one.severity for one in found] == ["warning"] * (not is_cleared)


def test_a_radio_that_comes_back_at_once_explains_little() -> None:
    made = Made()
    made.rows["ERR"] = [(50.0, {"Subsys": 5.0, "ECode": 1.0}), (50.2, {"Subsys": 5.0, "ECode": 0.0})]
    assert (first(made).kind, first(made).severity) == ("radio", "warning")
    made.rows["ERR"][1] = (80.0, {"Subsys": 5.0, "ECode": 0.0})
    assert first(made).severity == "critical"
    made.rows["ERR"][1] = (50.2, {"Subsys": 5.0, "ECode": 0.0})
    made.rows["MODE"] = [(0.0, {"ModeNum": 5.0, "Rsn": 1.0}), (50.1, {"ModeNum": 6.0, "Rsn": 3.0})]  # it acted
    assert first(made).severity == "critical"


def test_an_overloaded_autopilot() -> None:
    made = Made()
    made.table["PM"]["NLon"][made.after(FAILS_S)] = 1500
    assert first(made).kind == "cpu"


def test_parameters_changed_in_the_air() -> None:
    made = Made()
    flight = made.flight()
    changed = {**flight.settings, "ATC_RAT_RLL_P": (
        Setting("ATC_RAT_RLL_P", 0.135, "PARM"), Setting("ATC_RAT_RLL_P", 0.4, "PARM", changed_at_s=60.0),
    )}  # fmt: skip
    (finding,) = find(flight_of(made.tables(), changed, flight.log.facts, END_S))
    assert (finding.title, finding.severity) == ("parameters were changed in the air", "info")
    driven = find(flight_of(made.tables(), changed, {"firmware": "ArduRover V4.5.4", "vehicle": "rover"}, END_S))
    assert [one.title for one in driven if one.kind == "tuning"] == ["parameters were changed under way"]


def test_a_transmitter_that_is_off_on_the_ground_is_noted() -> None:
    made = Made()
    del made.rows["ARM"]
    made.table["CTUN"]["ThO"][:] = 0.0
    made.rows["MSG"] = [(20.0, {"Message": "PreArm: Need 3D Fix"}), (30.0, {"Message": "Radio Failsafe - Disarming"})]
    assert [one.severity for one in made.find() if one.kind == "radio"] == ["info"]


def test_a_submarine_that_leaks() -> None:
    assert leaks("ArduSub V4.5.0", code=1.0) == [60.0]
    assert leaks("ArduSub V4.5.0", message="Leak Detected") == [60.0]
    assert leaks("ArduSub V4.5.0", message="Leak detector is set up") == []
    assert leaks("ArduSub V4.5.0") == [], "code 0 says that it is over"
    assert leaks("ArduCopter V4.5.0", code=1.0) == []
    assert leaks("ArduSub V4.5.0", code=1.0, pins=(-1, 27, -1)) == [60.0]
    assert leaks("ArduSub V4.5.0", code=1.0, pins=(-1, -1, -1)) == [], "no detector: the firmware says so as it starts"


def test_a_failsafe_whose_text_comes_after_its_disarming_was_a_lost_radio() -> None:
    made = Made()
    made.rows["MSG"].append((DOWN_S + 5.1, {"Message": "Radio Failsafe - Disarming"}))
    assert "the radio link was lost" in [one.title for one in every_finding(made.find())]


@pytest.mark.parametrize(
    ("said", "pulse_us", "is_told"),
    [("PreArm: Radio failsafe on", 1500.0, True), ("", 874.0, True), ("", 1500.0, False), ("", 0.0, False)],
)
def test_a_failsafe_of_the_heartbeat_is_the_radios_by_its_text_or_its_pulse(
    said: str, pulse_us: float, is_told: bool
) -> None:
    made = Made()
    made.rows["MSG"].append((48.0, {"Message": said}))
    made.table["RCIN"] = {"C3": np.full(len(made.t), pulse_us)}
    made.table["STAT"] = {"Armed": np.ones(len(made.t)), "State": np.where(made.after(50.0, 59.0), 5.0, 4.0)}
    assert ("the radio link was lost" in [one.title for one in every_finding(made.find())]) is is_told


@pytest.mark.parametrize(
    ("source", "word"), [(1.0, "magnetic field"), (6.0, "heading from external navigation"), (None, "magnetic field")]
)
def test_the_test_of_the_heading_is_named_by_what_it_is_taken_from(source: float | None, word: str) -> None:
    made = Made()
    made.settings |= {} if source is None else {"EK3_SRC1_YAW": source}
    made.table["XKF4"]["SM"][made.after(50.0, 60.0)] = 2.3
    assert f"{word} 2.3" in next(one for one in every_finding(made.find()) if one.kind == "estimator").evidence


def test_telemetry_tells_in_words_what_a_log_records_of_the_estimator(monkeypatch: pytest.MonkeyPatch) -> None:
    made = Made()
    made.rows["MSG"] += [(60.0, {"Message": "EKF variance"})]
    flight = made.flight()
    assert not flight.errors(EKF_CHECK), "a log has records of its own"
    monkeypatch.setattr(type(flight), "is_telemetry", True)
    assert flight.errors(EKF_CHECK) == [(60.0, 2)]
    assert code_of("GPS Glitch or Compass error", GPS) == 2
    assert code_of("Glitch cleared", GPS) == 0
    assert code_of("Reached command #3", GPS) is None

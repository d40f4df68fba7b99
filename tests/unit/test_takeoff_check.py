"""Take-off: parameters of the motors' layout that the vehicle's answer shows wrong, and those that keep it down."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from care_core.ecosystems.ardupilot.checks import takeoff
from care_core.ecosystems.ardupilot.examining import find
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.findings import Finding
from care_core.run import Setting
from tests.flights import ARMED_S, UP_S, Made, flight_of


def with_defaults(made: Made, defaults: Mapping[str, float]) -> Flight:
    """The flight of a log that says what its firmware was shipped with."""
    known = {name: (Setting(name, value, "PARM", defaults.get(name, value)),) for name, value in made.settings.items()}
    return flight_of(made.tables(), known, made.facts)


def told(made: Made, defaults: Mapping[str, float]) -> tuple[Finding, ...]:
    return tuple(takeoff.find(with_defaults(made, defaults)))


def runs_away(made: Made, axis: str, seconds: float = 4.0, height_m: float = 0.8) -> None:
    """From its take-off on an axis turns faster and faster, against all that its controller gives."""
    t, n = made.t, len(made.t)
    made.table["RATE"] = {
        f"{one}{what}": made.noise(0.5) if what != "Out" else made.noise(0.01)
        for one in "RPY" for what in ("", "Des", "Out")
    }  # fmt: skip
    away = (t > UP_S + 1) & (t < UP_S + 1 + seconds)
    swing = np.where(np.arange(n) // 7 % 2 == 0, 1.0, -1.0) if axis != "Y" else np.ones(n)
    made.table["RATE"][axis][away] = (1200 * swing)[away]
    made.table["RATE"][f"{axis}Out"][away] = (-3.0 * swing)[away]
    for name, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt")):
        made.table[name][field] = np.clip(made.table[name][field], 0, height_m)


@pytest.mark.parametrize(("axis", "name"), [("R", "roll"), ("P", "pitch"), ("Y", "yaw")])
def test_a_rare_layout_is_named_where_an_axis_turns_against_its_output(axis: str, name: str) -> None:
    made = Made()
    made.settings["FRAME_TYPE"] = 19.0
    runs_away(made, axis)
    (finding,) = told(made, {"FRAME_TYPE": 1.0})
    assert (finding.title, finding.parameters) == (f"{name} turns against its motors at take-off", ("FRAME_TYPE",))
    assert finding.wanted == (("FRAME_TYPE", 1.0),)
    assert f"the {name} torque has the wrong sign at take-off: " in finding.evidence
    assert "1200 deg/s against an output of " in finding.evidence


def test_what_tips_over_once_is_no_wrong_layout() -> None:
    made = Made()
    made.settings["FRAME_TYPE"] = 19.0
    runs_away(made, "R", seconds=0.9)
    assert told(made, {"FRAME_TYPE": 1.0}) == ()


def test_a_usual_layout_is_not_named_whatever_turns_the_vehicle_over() -> None:
    made = Made()
    runs_away(made, "R")
    assert told(made, {"FRAME_TYPE": 0.0}) == ()  # an X, where the firmware is shipped as a plus
    made.settings |= {"FRAME_CLASS": 2.0}
    assert told(made, {"FRAME_CLASS": 1.0}) == ()


def test_what_has_flown_is_not_turned_by_its_layout() -> None:
    made = Made()
    made.settings["FRAME_TYPE"] = 19.0
    runs_away(made, "R", height_m=8.0)
    made.table["RATE"]["R"][made.t < UP_S + 5] = 0.0
    assert told(made, {"FRAME_TYPE": 1.0}) == ()


def test_another_class_of_frame_is_named_without_a_value() -> None:
    made = Made()
    made.settings["FRAME_CLASS"] = 12.0
    runs_away(made, "R")
    (finding,) = told(made, {"FRAME_CLASS": 1.0})
    assert (finding.parameters, finding.wanted) == (("FRAME_CLASS",), ())  # how many motors it has no log tells


def test_swapped_outputs_are_named_with_their_motors() -> None:
    made = Made()
    made.settings |= {"SERVO1_FUNCTION": 34.0, "SERVO2_FUNCTION": 33.0}
    runs_away(made, "P")
    (finding,) = told(made, {"SERVO1_FUNCTION": 0.0, "SERVO2_FUNCTION": 0.0})
    assert finding.wanted == (("SERVO1_FUNCTION", 33.0), ("SERVO2_FUNCTION", 34.0))


def test_a_wrong_layout_says_why_it_tipped_over() -> None:
    made = Made()
    made.settings["FRAME_TYPE"] = 18.0
    runs_away(made, "R", seconds=80.0)
    away = made.t > UP_S + 1
    made.table["ATT"]["Roll"][away] = 120.0
    made.table["ATT"]["DesRoll"][away] = 0.0
    findings = find(with_defaults(made, {"FRAME_TYPE": 1.0}))
    assert findings[0].parameters == ("FRAME_TYPE",)
    assert "it tipped over at take-off" not in [one.title for one in findings]


def idles(made: Made, seconds: float) -> None:
    """Armed in a mission, it idles and is disarmed for it."""
    made.rows["MODE"] = [(0.0, {"ModeNum": 3.0})]
    made.rows["ARM"] = [
        (ARMED_S, {"ArmState": 1.0, "Forced": 0.0, "Method": 1.0}),
        (ARMED_S + seconds, {"ArmState": 0.0, "Forced": 0.0, "Method": 17.0}),
    ]
    for name, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt"), ("CTUN", "ThO")):
        made.table[name][field] = np.zeros(len(made.t))


def test_a_speed_that_no_controller_reports_keeps_it_down() -> None:
    made = Made()
    made.settings |= {"TKOFF_RPM_MIN": 5000.0, "DISARM_DELAY": 10.0}
    idles(made, 10.0)
    (finding,) = told(made, {"TKOFF_RPM_MIN": 0.0})
    assert (finding.title, finding.wanted) == ("the motors were kept from spooling up", (("TKOFF_RPM_MIN", 0.0),))


def test_a_speed_that_the_motors_do_not_reach_is_named_with_it() -> None:
    made = Made()
    made.settings |= {"TKOFF_RPM_MIN": 5000.0}
    idles(made, 10.0)
    made.table["ESC"] = {"RPM": np.full(len(made.t), 1800.0)}
    (finding,) = told(made, {"TKOFF_RPM_MIN": 0.0})
    assert (finding.parameters, finding.wanted) == (("TKOFF_RPM_MIN",), ())
    assert "they report 1800 to 1800" in finding.evidence
    made.table["ESC"]["RPM"][:] = 5200.0
    assert told(made, {"TKOFF_RPM_MIN": 0.0}) == ()


def test_a_short_delay_disarms_before_it_rises() -> None:
    made = Made()
    made.settings["DISARM_DELAY"] = 1.0
    idles(made, 1.2)
    (finding,) = told(made, {"DISARM_DELAY": 10.0})
    assert (finding.title, finding.wanted) == ("it was disarmed before it rose", (("DISARM_DELAY", 10.0),))


def test_a_bench_that_idles_as_shipped_says_nothing() -> None:
    made = Made()
    made.settings["DISARM_DELAY"] = 10.0
    idles(made, 10.0)
    assert told(made, {"DISARM_DELAY": 10.0}) == ()
    made.settings["DISARM_DELAY"] = 5.0
    idles(made, 5.0)
    made.rows["MODE"] = [(0.0, {"ModeNum": 0.0})]  # the pilot flies it, and did not
    assert told(made, {"DISARM_DELAY": 10.0}) == ()


def driven_as_servos(made: Made) -> None:
    """All the throttle is given, two of four outputs rest, and it does not rise."""
    full = made.t > UP_S
    made.table["CTUN"]["ThO"] = np.where(full, 0.96, 0.0)
    for name, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt")):
        made.table[name][field] = 0.1 * np.sin(made.t)
    for output, pulse in (("C1", 1950.0), ("C2", 1940.0), ("C3", 1500.0), ("C4", 1490.0)):
        made.table["RCOU"][output] = np.where(full, pulse, 1000.0)


def test_motors_that_a_class_of_frame_drives_as_servos_are_told() -> None:
    made = Made()
    made.settings["FRAME_CLASS"] = 10.0
    driven_as_servos(made)
    (finding,) = told(made, {"FRAME_CLASS": 1.0})
    assert (finding.parameters, finding.wanted) == (("FRAME_CLASS",), ())
    assert "outputs 3, 4 stay within 50 us of 1500 us" in finding.evidence
    made.settings["FRAME_CLASS"] = 1.0
    assert told(made, {"FRAME_CLASS": 1.0}) == ()  # two motors that give nothing

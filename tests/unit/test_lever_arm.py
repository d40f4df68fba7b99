"""Arms of the GPS antenna and the IMU against the velocity that turns give."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.ecosystems.ardupilot.checks import lever_arm
from care_core.ecosystems.findings import Finding
from tests.flights import UP_S, Made


def turning(arm_m: tuple[float, float, float], **settings: float) -> Made:
    """A flight that turns to and fro over a heading that goes round, with an arm in its estimate that is not there."""
    made = Made()
    t = made.t
    made.settings |= settings
    yaw_dps = 60 * np.sin(t) * (t > UP_S + 5)
    heading = np.radians(np.cumsum(yaw_dps) * 0.1)
    made.table["ATT"]["Yaw"] = np.degrees(heading) % 360
    made.table["RATE"] = {"R": made.noise(0.5), "P": made.noise(0.5), "Y": yaw_dps}
    turn = np.radians(yaw_dps)
    ahead, right = -turn * arm_m[1], turn * arm_m[0]
    made.table["XKF3"] = {
        "C": np.zeros(len(t)),
        "IVN": ahead * np.cos(heading) - right * np.sin(heading) + made.noise(0.05),
        "IVE": ahead * np.sin(heading) + right * np.cos(heading) + made.noise(0.05),
        "IVD": made.noise(0.05),
    }  # fmt: skip
    return made


def told(made: Made) -> tuple[Finding, ...]:
    return tuple(lever_arm.find(made.flight()))


@pytest.mark.parametrize(
    ("arm_m", "parameter", "value"),
    [
        ((3.0, 0.0, 0.0), "GPS_POS1_X", 3.0),
        ((0.0, -2.0, 0.0), "GPS1_POS_Y", -2.0),
        ((-2.0, 0.0, 0.0), "INS_POS1_X", 2.0),
    ],
)
def test_an_arm_that_is_not_there_is_named(arm_m: tuple[float, float, float], parameter: str, value: float) -> None:
    (finding,) = told(turning(arm_m, **{parameter: value}))
    assert (finding.parameters, finding.wanted) == ((parameter,), ((parameter, 0.0),))
    assert finding.severity == "warning"


def test_an_arm_that_is_there_leaves_no_trace() -> None:
    assert told(turning((0.0, 0.0, 0.0), GPS_POS1_X=3.0)) == ()


def test_innovations_without_an_arm_are_no_arms_fault() -> None:
    assert told(turning((3.0, 0.0, 0.0))) == ()
    assert told(turning((0.0, 3.0, 0.0), GPS_POS1_X=3.0)) == ()  # they follow another


def test_an_ekf_failsafe_after_it_makes_it_critical() -> None:
    made = turning((3.0, 0.0, 0.0), GPS_POS1_X=3.0)
    made.rows["ERR"] = [(60.0, {"Subsys": 17.0, "ECode": 1.0})]
    (finding,) = told(made)
    assert (finding.severity, finding.mission_lost) == ("critical", 0.95)


def test_arms_of_several_axes_are_named_together_without_a_value() -> None:
    (finding,) = told(turning((3.0, -2.0, 0.0), GPS_POS1_X=3.0, GPS_POS1_Y=-2.0))
    assert (finding.parameters, finding.wanted) == (("GPS_POS1_X", "GPS_POS1_Y"), ())

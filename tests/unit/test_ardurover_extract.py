"""What is read of a rover's drive: planted drives of two legs, a wait, a turn on the spot."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from care_core.ecosystems.ardupilot.measures import rover  # noqa: F401  it registers its extractors
from care_core.ecosystems.ardupilot.measures.flown_mission import analyse
from care_core.ecosystems.measures import MISSION_KINDS, Mission, find_extractor
from care_core.ecosystems.vehicles import is_skid_steered
from care_core.logs.base import Table
from care_core.records import replace
from care_core.run import Unavailable, Value
from tests.tables import read

KIND = MISSION_KINDS["ardupilot_flight"]
HOME = (47.0, 8.0)
METRES = 111_319.49
EAST = METRES * math.cos(math.radians(HOME[0]))
FACTS = {"firmware": "ArduRover V4.5.4"}
SKID = {"SERVO1_FUNCTION": 73.0, "SERVO3_FUNCTION": 74.0, "MOT_THR_MAX": 40.0}
AT = np.arange(0.0, 65.0, 0.5)


def table(rows: list[tuple[Any, ...]], *fields: str) -> Table:
    columns = list(zip(*rows, strict=True))
    typed = (np.array(column, dtype=object if isinstance(column[0], str) else float) for column in columns[1:])
    return Table(np.array(columns[0], dtype=float), dict(zip(fields, typed, strict=True)))


def drive(**replaced: Table) -> dict[str, Table]:
    """100 m north at 4 m/s from 10 to 35 s, 5 s of waiting, 60 m east until 55 s; armed from 10 to 60 s. On the way
    north it is 2 m off for a while, after the wait it turns on the spot for 2 s, later for 1 s while it drives."""
    north = np.interp(AT, [10, 35, 65], [0, 100, 100])
    east = np.interp(AT, [20, 22, 26, 28, 40, 55, 65], [0, 2, 2, 0, 0, 60, 60])
    moving = ((AT >= 10) & (AT < 35)) | ((AT >= 42) & (AT < 55))
    turn = np.where((AT >= 40) & (AT < 42), 45.0, 0.0) + np.where((AT >= 45) & (AT < 46), 20.0, 0.0)
    level = np.zeros_like(AT)
    tables = {
        "ARM": table([(10.0, 1, 0), (60.0, 0, 0)], "ArmState", "Forced"),
        "MODE": table([(0.0, 10)], "ModeNum"),
        "MSG": table(
            [
                (5.0, "Mission: 1 WP"),
                (35.0, "Reached waypoint #1. Loiter for 5 seconds"),
                (40.0, "Mission: 2 WP"),
                (55.0, "Reached waypoint #2"),
                (55.0, "Mission Complete"),
            ],
            "Message",
        ),
        "CMD": table(
            [
                (0.0, 0, 16, 0.0, *HOME, 0.0),
                (0.0, 1, 16, 5.0, HOME[0] + 100 / METRES, HOME[1], 0.0),
                (0.0, 2, 16, 0.0, HOME[0] + 100 / METRES, HOME[1] + 60 / EAST, 0.0),
            ],
            "CNum", "CId", "Prm1", "Lat", "Lng", "Alt",
        ),
        "ORGN": table([(9.0, 1, *HOME)], "Type", "Lat", "Lng"),
        "POS": Table(AT, {"Lat": HOME[0] + north / METRES, "Lng": HOME[1] + east / EAST, "RelHomeAlt": level}),
        "BAT": Table(AT, {"Volt": level + 12.0 - 1e-9 * AT, "Curr": np.where(moving, 10.0, 0.5)}),
        "THR": Table(AT, {"ThrOut": 40.0 * moving, "DesSpeed": 5.0 * moving, "Speed": 4.0 * moving}),
        "STER": Table(AT, {"SteerOut": turn * 100, "LatAcc": turn / 10, "DesTurnRate": turn * 2, "TurnRate": turn}),
    }  # fmt: skip
    return {**tables, **replaced}


def only(tables: Mapping[str, Table], **settings: float) -> Mission:
    (mission,) = KIND.missions(*read(tables, 65.0, facts=FACTS), {})
    return replace(mission, settings={**SKID, **settings})


def value(mission: Mission, kind: str, **args: Any) -> Value:
    return find_extractor(kind).compute(mission, args)


def messages(*but: str) -> Table:
    said = drive()["MSG"]
    return said.where(np.array([not any(word in text for word in but) for text in said["Message"]]))


def test_a_good_drive() -> None:
    mission = only(drive())
    assert value(mission, "mission_success") == 1.0
    assert value(mission, "phase_time", phase="mission") == 45.0
    assert value(mission, "phase_time", phase="leg", index=1) == 25.0
    assert value(mission, "phase_time", phase="hold", index=1) == 5.0
    assert isinstance(value(mission, "phase_time", phase="hold", index=2), Unavailable)
    assert value(mission, "waypoints_reached") == 2.0
    assert value(mission, "cruise_speed") == pytest.approx(160 / 40)
    assert value(mission, "path_error") == pytest.approx(2.0, abs=0.1)
    assert value(mission, "waypoint_miss") == pytest.approx(0.0, abs=1e-6)
    assert value(mission, "distance") == pytest.approx(160, rel=0.02)
    # 38 s at 120 W, 7 s at 6 W; the rest of the armed time costs more.
    assert value(mission, "energy_used", phase="mission") == pytest.approx((38 * 120 + 7 * 6) / 3600, rel=0.03)


def test_speed_and_steering_wanted_and_driven() -> None:
    mission = only(drive())
    share = 38 / 45.5
    assert value(mission, "speed_error") == pytest.approx(math.sqrt(share), rel=0.02)
    assert value(mission, "drive_throttle") == pytest.approx(40 * share, rel=0.02)
    assert value(mission, "throttle_saturation") == pytest.approx(share, rel=0.02)
    assert value(only(drive(), MOT_THR_MAX=15.0), "throttle_saturation") == pytest.approx(
        share, rel=0.02
    )  # counts as 30
    assert value(only(drive(), MOT_THR_MAX=90.0), "throttle_saturation") == 0.0
    assert value(mission, "turning_time", how="spot") == 2.0
    assert value(mission, "turning_time", how="driving") == 1.0
    assert value(mission, "steering_saturation") == pytest.approx(4 / 91)
    assert value(mission, "turn_rate_error", phase="leg", index=1) == 0.0


def test_what_the_vehicle_is_like() -> None:
    mission = only(drive())
    assert value(mission, "steering_kind") == 1.0
    assert value(mission, "full_throttle_speed") == pytest.approx(10.0)
    assert value(mission, "energy_per_metre") == pytest.approx(30.0)
    assert is_skid_steered({"SERVO1_FUNCTION": 26.0, "SERVO3_FUNCTION": 70.0}) is False
    assert is_skid_steered({"SERVO1_FUNCTION": 0.0}) is None


def test_of_a_vehicle_that_hardly_moved_nothing_is_known() -> None:
    noise = np.abs(np.sin(AT)) / 10
    stuck = only(drive(THR=Table(AT, {"ThrOut": noise + 40, "DesSpeed": noise + 5, "Speed": noise})))
    assert isinstance(value(stuck, "full_throttle_speed"), Unavailable)
    assert isinstance(value(stuck, "energy_per_metre"), Unavailable)


def test_a_drive_that_reached_all_and_is_not_complete_is_no_success() -> None:
    assert value(only(drive(MSG=messages("Complete"))), "mission_success") == 0.0
    assert value(only(drive(MSG=messages("#2"))), "mission_success") == 0.0


def test_a_mission_that_is_complete_is_over_though_the_log_ends_before_it_is_disarmed() -> None:
    armed = table([(10.0, 1, 0)], "ArmState", "Forced")
    complete = only(drive(ARM=armed))
    assert not complete.ended
    assert KIND.is_decided(complete)
    assert value(complete, "mission_success") == 1.0
    cut = only(drive(ARM=armed, MSG=messages("Complete", "#2")))
    assert not KIND.is_decided(cut)
    assert isinstance(value(cut, "mission_success"), Unavailable)
    assert value(cut, "phase_time", phase="mission") == 55.0


def test_a_mission_begins_where_its_mode_does() -> None:
    later = only(drive(MODE=table([(0.0, 0), (12.0, 10)], "ModeNum")))
    drove = later.shared(analyse).drive
    assert drove is not None
    assert (drove.start_s, drove.end_s) == (12.0, 55.0)


def test_a_failsafe_fails_the_mission() -> None:
    said = drive()["MSG"]
    more = Table(np.append(said.t, 56.0), {"Message": np.append(said["Message"], "EKF failsafe")})
    mission = only(drive(MSG=more))
    assert value(mission, "mission_success") == 0.0
    assert value(mission, "failsafe", about="EKF") == 1.0


def test_corners_of_what_was_asked() -> None:
    mission = only(drive())
    assert value(mission, "mission_asked", what="sharp_turns") == pytest.approx(90.0)
    assert value(mission, "mission_asked", what="sharp_corners") == 0.0  # it waits there


def test_the_way_home_of_a_rover_is_a_leg_like_any() -> None:
    items = drive()["CMD"]
    home = table([(0.0, 3, 20, 0.0, 0.0, 0.0, 0.0)], "CNum", "CId", "Prm1", "Lat", "Lng", "Alt")
    columns = {name: np.append(items[name], home[name]) for name in items.columns}
    returns = only(drive(CMD=Table(np.append(items.t, home.t), columns)))
    assert value(only(drive()), "mission_asked", what="path_length") == pytest.approx(160.0, abs=0.1)
    assert value(returns, "mission_asked", what="path_length") == pytest.approx(160.0 + math.hypot(100, 60), abs=0.1)
    assert value(returns, "mission_asked", what="legs") == 3.0

"""What each parameter of ArduPilot and PX4 does: the tables, and how a parameter finds its row."""

from __future__ import annotations

from pathlib import Path

import pytest

from care_core.metadata import ardupilot, px4
from care_core.metadata.causal_map import READS, ROLES, SIGNS, TABLE, TABLE_OF_PX4, meaning_of
from care_core.metadata.fact import expanded


def rows_of(table: Path) -> list[list[str]]:
    lines = table.read_text(encoding="utf-8").splitlines()
    return [line.split("\t") for line in lines if not line.startswith("#")][1:]


ROWS, PX4_ROWS = rows_of(TABLE), rows_of(TABLE_OF_PX4)
EITHER = pytest.mark.parametrize("rows", [ROWS, PX4_ROWS], ids=["ardupilot", "px4"])
PX4_RELEASES = {"1.13", "1.14", "1.15", "1.16", "1.17"}
UNDOCUMENTED = {
    "AMP_PER_VOLT", "ANGLE_RATE_MAX", "AXIS_ENABLE", "EPM_*", "FRAME", "FS_GPS_ENABLE", "GCS_SYSID", "GPSGLITCH_*",
    "HLD_*", "INAV_TC_*", "INS_MPU6K_FILTER", "LED_MODE", "LOITER_{LAT|LON}_*", "LOW_VOLT",
    "MOT_{TCRV_ENABLE|TCRV_MAXPCT|TCRV_MIDPCT|THST_MAX}", "ODID_*", "OF_*", "RATE_YAW_*", "RATE_{PIT|RLL}_*", "SIM_*",
    "SONAR_*", "STB_YAW_*", "STB_{PIT|RLL}_*", "THR_ACCEL_*", "THR_{ALT|RATE}_*", "VOLT_DIVIDER", "WP_{INDEX|TOTAL}",
}  # fmt: skip
"""Rows of parameters that only firmware before the first release of the table has, or only the simulator."""


@EITHER
def test_every_row_is_in_known_words(rows: list[list[str]]) -> None:
    for _, vehicles, role, part, read, signs in rows:
        assert role in ROLES
        assert read
        assert set(read.split()) <= set(READS)
        assert set(signs.split()) <= set(SIGNS)
        assert set(vehicles) <= set("CPRST")
        assert 0 < len(part.split()) <= 3
    assert sorted(rows) == rows


@EITHER
def test_what_nothing_reads_shows_nothing_and_what_is_safety_shows_something(rows: list[list[str]]) -> None:
    for pattern, _, role, _, read, signs in rows:
        if read == "never":
            assert not signs, pattern
        if role == "safety" and read != "never":
            assert signs, pattern
        assert (role == "idle") <= (read == "never"), pattern


def strangers(rows: list[list[str]], known: set[str]) -> set[str]:
    beginnings = {name[:length] for name in known for length in range(1, len(name) + 1)}
    return {
        row[0]
        for row in rows
        if known.isdisjoint(expanded(row[0]))
        and not any(one.endswith("*") and one[:-1] in beginnings for one in expanded(row[0]))
    }


def test_every_row_is_of_parameters_that_are_known() -> None:
    assert strangers(ROWS, set(ardupilot.names())) == UNDOCUMENTED
    assert not strangers(PX4_ROWS, set(px4.names()))


@EITHER
def test_no_row_stands_twice(rows: list[list[str]]) -> None:
    named = [
        (one, vehicle) for pattern, vehicles, *_ in rows for one in expanded(pattern) for vehicle in vehicles or "*"
    ]
    assert len(named) == len(set(named))


@pytest.mark.parametrize("kind", ["copter", "rover", "plane", "sub"])
def test_every_documented_parameter_has_a_meaning(kind: str) -> None:
    letter = ardupilot.VEHICLES[kind]
    own = [name for name in ardupilot.names() if any(one.vehicle == letter for one in ardupilot.known_in(name))]
    assert [name for name in own if meaning_of(name, kind) is None] == []


def test_every_parameter_of_px4_has_a_meaning() -> None:
    own = [name for name in px4.names() if PX4_RELEASES & px4.known_in(name)]
    assert [name for name in own if meaning_of(name, "px4") is None] == []


def test_a_name_counts_before_its_family_and_a_longer_family_before_a_shorter() -> None:
    named, family = meaning_of("RTL_ALT_TYPE", "copter"), meaning_of("RTL_NEW_ONE", "copter")
    assert named is not None
    assert family is not None
    assert named.signs == {"refused", "height", "failsafe_terrain"}
    assert family.signs == {"slow_rtl", "elsewhere"}
    yaw, rate = meaning_of("ATC_RAT_YAW_FLTD", "copter"), meaning_of("ATC_RAT_PIT_FLTD", "copter")
    assert yaw is not None
    assert rate is not None
    assert (yaw.part, rate.part) == ("yaw rate control", "rate control filters")


def test_a_vehicle_s_own_row_counts_before_one_for_all() -> None:
    rover, copter = meaning_of("SERVO1_TRIM", "rover"), meaning_of("SERVO1_TRIM", "copter")
    assert rover is not None
    assert copter is not None
    assert copter.signs == {"refused"}  # motors are driven from MOT_PWM_MIN to MOT_PWM_MAX
    assert "strays" in rover.signs
    assert meaning_of("MOT_SLEWRATE", "rover") != meaning_of("MOT_SLEWRATE", "copter")


@pytest.mark.parametrize(
    ("old_or_new", "today"),
    [("RTL_SPEED_MS", "RTL_SPEED"), ("FS_BATT_MAH", "BATT_LOW_MAH"), ("STB_RLL_P", "ATC_ANG_RLL_P"),
     ("GPS1_TYPE", "GPS_TYPE"), ("WP_SPD", "WPNAV_SPEED"), ("SYSID_MYGCS", "MAV_GCS_SYSID")],
)  # fmt: skip
def test_an_older_or_newer_name_means_the_same(old_or_new: str, today: str) -> None:
    other, own = meaning_of(old_or_new, "copter"), meaning_of(today, "copter")
    assert other is not None
    assert own is not None
    assert other.name == old_or_new
    assert (other.role, other.read) == (own.role, own.read)


@pytest.mark.parametrize(
    ("name", "role", "read", "sign"),
    [
        ("RTL_LOIT_TIME", "choice", "rtl", "slow_rtl"),
        ("LAND_ALT_LOW", "choice", "land", "slow_land"),
        ("PHLD_BRAKE_RATE", "choice", "manual", "strays"),
        ("TKOFF_RPM_MIN", "safety", "takeoff", "no_takeoff"),
        ("SURFTRAK_MODE", "choice", "rangefinder", "height"),
        ("EK3_BCN_DELAY", "choice", "beacon", "position"),
        ("EK3_FLOW_USE", "choice", "flow", "position"),
        ("FRAME_TYPE", "wiring", "always", "tipped"),
        ("SCHED_LOOP_RATE", "choice", "always", "loop"),
        ("BATT_LOW_MAH", "safety", "battery", "failsafe_battery"),
        ("INS_ACC2OFFS_X", "calibration", "arming", "refused"),
        ("GPS_POS1_Z", "wiring", "always", "failsafe_estimator"),
        ("MOT_THST_HOVER", "written", "takeoff", "height"),
    ],
)
def test_a_parameter_answers_where_the_firmware_reads_it(name: str, role: str, read: str, sign: str) -> None:
    meaning = meaning_of(name, "copter")
    assert meaning is not None
    assert meaning.role == role
    assert read in meaning.read
    assert sign in meaning.signs


def test_an_offset_of_heights_that_a_plane_stands_above_ends_its_take_off() -> None:
    meaning = meaning_of("ALT_OFFSET", "plane")
    assert meaning is not None
    assert {"no_takeoff", "height"} <= meaning.signs


def test_what_is_read_in_no_flight_clears_a_parameter() -> None:
    for name in ("NTF_LED_BRIGHT", "LOG_DISARMED", "COMPASS_CAL_FIT", "INS_TRIM_OPTION", "GPS_INJECT_TO"):
        meaning = meaning_of(name, "copter")
        assert meaning is not None
        assert meaning.read == {"never"}
        assert not meaning.signs


def test_what_no_table_knows_has_no_meaning() -> None:
    assert meaning_of("XYZ_NOTHING", "copter") is None
    assert meaning_of("RC_SPEED", "unknown") is None

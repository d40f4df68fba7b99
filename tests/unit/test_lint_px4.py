"""Parameter files of PX4: names by release, types, ranges and listed values as its parameter reference has them."""

from __future__ import annotations

from pathlib import Path

import pytest

from care_core.files import bundled
from care_core.lint.linting import lint
from care_core.lint.problems import Problem
from care_core.metadata import px4
from tests.conftest import Care

PLAIN = {
    "MC_ROLLRATE_P": 0.15,
    "MC_PITCHRATE_P": 0.15,
    "MPC_XY_VEL_MAX": 12.0,
    "NAV_ACC_RAD": 2.0,
    "COM_DISARM_LAND": 2.0,
}


def written(values: dict[str, float], version: str = "1.15.4") -> str:
    head = f"# Stack: PX4 Pro\n# Vehicle: Multi-Rotor\n# Version: {version}\n" if version else ""
    rows = (f"1\t1\t{name}\t{value:g}\t{6 if value.is_integer() else 9}" for name, value in values.items())
    return head + "\n".join(rows) + "\n"


def found(tmp_path: Path, values: dict[str, float], version: str = "1.15.4", target: str = "") -> list[Problem]:
    path = tmp_path / "a.params"
    path.write_text(written(PLAIN | values, version))
    (linted,) = lint([str(path)], target)
    return list(linted.problems)


def told(tmp_path: Path, values: dict[str, float], version: str = "1.15.4", target: str = "") -> list[tuple[str, str]]:
    return [(one.rule, one.severity.value) for one in found(tmp_path, values, version, target)]


@pytest.mark.parametrize(
    ("values", "rule", "severity", "says"),
    [
        ({"MC_ROLLRATE_P": 1.5}, "out-of-range", "warning", "1.5, outside 0.01 to 0.5"),
        ({"MC_ROLLRATE_P": 0.6}, "out-of-range", "note", "The firmware takes it"),
        ({"MPC_XY_P": -0.95}, "out-of-range", "warning", "-0.95, outside 0 to 2"),
        ({"COM_ARM_BAT_MIN": -1.0}, "out-of-range", "note", "-1"),
        ({"NAV_RCL_ACT": 4.0}, "not-in-values", "warning", "They are 1, 2, 3, 5, 6"),
        ({"EKF2_GPS_CHECK": 4095.0}, "not-in-values", "note", "bits 9, 10 and 11"),
        ({"MPC_POS_MODE": 4.5}, "wrong-type", "warning", "whole numbers"),
        ({"MC_ROLRATE_K": 1.0}, "unknown-key", "warning", "Did you mean MC_ROLLRATE_K?"),
        ({"MY_OWN_THING": 1.0}, "unknown-key", "note", "a custom build's"),
        ({"MPC_XY_VEL_P": 0.09}, "renamed", "warning", "Write MPC_XY_VEL_P_ACC, and its value times 20."),
        ({"FW_THR_CRUISE": 0.6}, "renamed", "warning", "Write FW_THR_TRIM."),
        ({"SYS_USE_IO": 1.0}, "unknown-key", "warning", "not in PX4 1.15, but in PX4 1.6 to 1.14"),
    ],
)
def test_what_the_reference_of_a_release_says_of_a_value(
    tmp_path: Path, values: dict[str, float], rule: str, severity: str, says: str
) -> None:
    (problem,) = found(tmp_path, values)
    assert (problem.rule, problem.severity.value) == (rule, severity)
    assert says in f"{problem.text} {problem.hint}"
    assert problem.parameter in values
    assert "PX4" in problem.source


def test_defaults_calibration_and_what_is_as_documented_raise_nothing(tmp_path: Path) -> None:
    fine = {"BAT1_N_CELLS": 0.0, "CAL_ACC0_XSCALE": 7.0, "LND_FLIGHT_T_LO": -5.0, "PWM_MAIN_FUNC4": 104.0}
    assert told(tmp_path, {**fine, "SER_TEL1_BAUD": 57600.0, "COM_FLTMODE1": -1.0}) == []


def test_what_is_no_number_is_told_once(tmp_path: Path) -> None:
    assert told(tmp_path, {"MC_ROLLRATE_P": float("nan")}) == [("wrong-type", "error")]


def test_the_release_comes_from_the_header_the_operator_or_the_names(tmp_path: Path) -> None:
    old = {"MPC_LAND_SPEED": 0.7, "SYS_USE_IO": 1.0, "MC_AIRMODE": 0.0}
    assert told(tmp_path, old, "1.13.3") == []
    assert told(tmp_path, old, "1.13.3", "px4-1.15") == [("unknown-key", "warning")]
    assert told(tmp_path, {"SYS_USE_IO": 1.0}, "1.15.0 alpha") == [], "it may still have what the release leaves out"
    assert told(tmp_path, old, "") == [], "the names tell that it is of 1.14 at the latest"
    assert told(tmp_path, {"MY_OWN_THING": 1.0}, "1.19.0") == [], "nobody knows the names of releases to come"


def test_files_of_ardupilot_stay_with_its_own_lists(tmp_path: Path) -> None:
    path = tmp_path / "a.param"
    path.write_text("ANGLE_MAX,3000\nRTL_ALT,1500\nATC_RAT_RLL_P,0.135\nRC1_MIN,1100\n")
    (linted,) = lint([str(path)])
    assert linted.problems == ()
    path.write_text("RC1_MIN,1100\nRC1_MAX,1900\n")
    assert lint([str(path)])[0].problems == (), "both have these names"


def test_every_new_name_is_known_where_the_old_one_is_not() -> None:
    for old, (new, _) in px4.RENAMED.items():
        assert px4.known_in(old), old
        assert px4.known_in(new) - px4.known_in(old), new


def test_families_and_releases_of_the_table() -> None:
    assert px4.known_in("CAL_GYRO2_ID")
    assert px4.known_in("PWM_AUX_DIS3")
    assert "1.16" in px4.known_in("MPC_VEL_LP")
    assert "1.15" not in px4.known_in("MPC_VEL_LP")
    (old,), (new,) = (px4.facts_of("MIS_DIST_1WP", (one,)) for one in ("1.15", "1.16"))
    assert (old.default, new.default) == ("900", "10000")
    assert all(low is None or high is None or low <= high for name in px4.names() for one in px4.facts_of(name)
               for low, high in [(one.low, one.high)])  # fmt: skip


@pytest.mark.parametrize(("sample", "told"), [("px4_failed.ulg", "PX4 1.15"), ("arducopter_failed.BIN", "Copter 4.5")])
def test_a_file_that_care_wrote_says_which_firmware_it_is_of(
    sample: str, told: str, tmp_path: Path, care: Care
) -> None:
    path = tmp_path / "driven.params"
    assert care("params", str(bundled("samples", sample)), "--out", str(path)).code == 0
    assert "# Firmware: " in path.read_text().splitlines()[1]
    path.write_text(path.read_text() + ("1\t1\tSYS_USE_IO\t1\t6\n" if told.startswith("PX4") else "LAND_SPD_MS,0.5\n"))
    (problem,) = (one for one in lint([str(path)])[0].problems if one.parameter in ("SYS_USE_IO", "LAND_SPD_MS"))
    assert problem.severity.value == "warning"
    assert told in problem.text

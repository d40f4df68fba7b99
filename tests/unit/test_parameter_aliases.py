"""A profile's options under the names and units of the firmware that flew."""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

import pytest

from care_core.configs.changes import apply_commands
from care_core.configs.driven import configuration
from care_core.ecosystems.ardupilot.dialect import ARDUPILOT_PARAM
from care_core.extract.parameter_aliases import with_logged_names
from care_core.logs import formats
from care_core.logs.base import Log
from care_core.logs.formats import LogFormat
from care_core.profile.schema import Schema
from care_core.profile.store import load_profile
from care_core.records import Struct, field
from care_core.run import Setting
from care_core.variables import Change, Role, Variable

SPEED = Variable("WPNAV_SPEED", Role.OPTION, parameters=("WPNAV_SPEED",), range=(150, 1800), unit="cm/s")
SCHEMA = Schema("copter", "1", "copter", "", {}, ("dataflash-bin",), False, {}, (), {"WPNAV_SPEED": SPEED})


class Flown(Struct, eq=False):
    """A log of which only firmware and parameters matter."""

    held: Mapping[str, float]
    facts: Mapping[str, str] = field(default_factory=lambda: {"firmware": "ArduCopter V4.7.0"})
    format: LogFormat = formats.DATAFLASH_BIN

    def settings(self) -> Mapping[str, tuple[Setting, ...]]:
        return {name: (Setting(name, value, "PARM"),) for name, value in self.held.items()}


def option_in(**held: float) -> tuple[Variable, dict[str, float]]:
    log = Flown(held)
    option = with_logged_names(SCHEMA, cast(Log, log)).variables["WPNAV_SPEED"]
    driven = {name: history[0] for name, history in log.settings().items()}
    return option, configuration([option], driven, {})[0]


def test_a_renamed_parameter_is_read_in_the_unit_of_the_option() -> None:
    option, config = option_in(WP_SPD=10.0)
    assert option.parameters == ("WP_SPD",)
    assert config == {"WPNAV_SPEED": 1000.0}


def test_a_change_is_written_in_the_unit_of_the_parameter() -> None:
    option, _ = option_in(WP_SPD=10.0)
    assert apply_commands([Change(option, 1000.0, 1250.0)], ARDUPILOT_PARAM) == ["param set WP_SPD 12.5"]


def test_firmware_with_the_profiles_own_name_changes_nothing() -> None:
    option, config = option_in(WPNAV_SPEED=500.0)
    assert option is SPEED
    assert config == {"WPNAV_SPEED": 500.0}


def test_a_log_without_the_parameter_leaves_the_option_as_it_is() -> None:
    option, config = option_in(OTHER=1.0)
    assert option is SPEED
    assert config == {}


RENAMED_47: Mapping[str, tuple[str, float]] = {
    "WPNAV_SPEED": ("WP_SPD", 0.01), "WPNAV_ACCEL": ("WP_ACC", 0.01), "WPNAV_RADIUS": ("WP_RADIUS_M", 0.01),
    "WPNAV_JERK": ("WP_JERK", 1), "WPNAV_SPEED_UP": ("WP_SPD_UP", 0.01), "WPNAV_SPEED_DN": ("WP_SPD_DN", 0.01),
    "PSC_POSXY_P": ("PSC_NE_POS_P", 1), "PSC_VELXY_P": ("PSC_NE_VEL_P", 1), "PSC_VELXY_I": ("PSC_NE_VEL_I", 1),
    "PSC_VELXY_D": ("PSC_NE_VEL_D", 1), "PSC_POSZ_P": ("PSC_D_POS_P", 1), "PSC_VELZ_P": ("PSC_D_VEL_P", 1),
    "PSC_ACCZ_P": ("PSC_D_ACC_P", 0.1), "PSC_ACCZ_I": ("PSC_D_ACC_I", 0.1), "ANGLE_MAX": ("ATC_ANGLE_MAX", 0.01),
    "RTL_ALT": ("RTL_ALT_M", 0.01), "LAND_SPEED": ("LAND_SPD_MS", 0.01), "GPS_DELAY_MS": ("GPS1_DELAY_MS", 1),
}  # fmt: skip
"""The profile's options that have another name in 4.7, with the share of their value; the other 15 kept theirs."""


def test_every_option_of_the_copter_is_read_from_firmware_4_7_and_from_4_0() -> None:
    schema = load_profile("arducopter").schema
    defaults = {option.name: option.default for option in schema.options}
    held = {}
    for name, default in defaults.items():
        assert default is not None
        new, scale = RENAMED_47.get(name, (name, 1))
        held[new] = default * scale
    assert len(held) == len(defaults) == 33
    read = with_logged_names(schema, cast(Log, Flown(held)))
    driven = {name: history[0] for name, history in Flown(held).settings().items()}
    assert configuration(read.options, driven, {})[0] == pytest.approx(defaults)
    old = Flown({name: value for name, value in defaults.items() if value is not None}, {"firmware": "ArduCopter V4.0"})
    assert with_logged_names(schema, cast(Log, old)) is schema

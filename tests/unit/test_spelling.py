"""A profile's options under the names and units of the firmware that flew."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import cast

from care_core.configs.changes import apply_commands
from care_core.configs.driven import configuration
from care_core.configs.formats import ConfigFormat
from care_core.extract.spelling import spelled
from care_core.logs.base import Log
from care_core.profile.schema import Schema
from care_core.run import Setting
from care_core.variables import Change, Role, Variable

SPEED = Variable("WPNAV_SPEED", Role.OPTION, parameters=("WPNAV_SPEED",), range=(150, 1800), unit="cm/s")
SCHEMA = Schema("copter", "1", "copter", "", {}, ("dataflash-bin",), False, {}, (), {"WPNAV_SPEED": SPEED})


@dataclass
class Flown:
    """A log of which only firmware and parameters matter."""

    held: Mapping[str, float]
    facts: Mapping[str, str] = field(default_factory=lambda: {"firmware": "ArduCopter V4.7.0"})

    def settings(self) -> Mapping[str, tuple[Setting, ...]]:
        return {name: (Setting(name, value, "PARM"),) for name, value in self.held.items()}


def option_in(**held: float) -> tuple[Variable, dict[str, float]]:
    log = Flown(held)
    option = spelled(SCHEMA, cast(Log, log)).variables["WPNAV_SPEED"]
    driven = {name: history[0] for name, history in log.settings().items()}
    return option, configuration([option], driven, {})[0]


def test_a_renamed_parameter_is_read_in_the_unit_of_the_option() -> None:
    option, config = option_in(WP_SPD=10.0)
    assert option.parameters == ("WP_SPD",)
    assert config == {"WPNAV_SPEED": 1000.0}


def test_a_change_is_written_in_the_unit_of_the_parameter() -> None:
    option, _ = option_in(WP_SPD=10.0)
    assert apply_commands([Change(option, 1000.0, 1250.0)], ConfigFormat.ARDUPILOT_PARAM) == ["param set WP_SPD 12.5"]


def test_firmware_with_the_profiles_own_name_changes_nothing() -> None:
    option, config = option_in(WPNAV_SPEED=500.0)
    assert option is SPEED
    assert config == {"WPNAV_SPEED": 500.0}


def test_a_log_without_the_parameter_leaves_the_option_as_it_is() -> None:
    option, config = option_in(OTHER=1.0)
    assert option is SPEED
    assert config == {}

"""Parameters that a run itself shows to be wrong, and the value that it shows instead."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.ecosystems.findings import Finding
from care_core.run import Setting
from tests.flights import ARMED_S, DOWN_S, Made

FAILSAFE_S = 60.0


class MadeWithDefaults(Made):
    """A made flight whose log tells the defaults of what was driven off them."""

    def __init__(self) -> None:
        super().__init__()
        self.defaults: dict[str, float] = {}

    def drive(self, name: str, value: float, default: float) -> None:
        self.settings[name], self.defaults[name] = value, default

    @property
    def known(self) -> dict[str, tuple[Setting, ...]]:
        values = self.settings.items()
        return {name: (Setting(name, value, "PARM", default=self.defaults.get(name)),) for name, value in values}


def naming(made: Made, parameter: str) -> Finding:
    found = [one for one in made.find() if parameter in one.parameters]
    assert found, f"{parameter} is not named"
    return found[0]


def fails_at(made: Made, text: str) -> None:
    made.rows["ERR"] = [(FAILSAFE_S, {"Subsys": 6.0, "ECode": 1.0})]
    made.rows["MSG"].append((FAILSAFE_S, {"Message": text}))


# --- the battery


@pytest.mark.parametrize("scale", [8.2, 9.0, 13.0])
def test_a_voltage_that_only_the_default_scale_makes_full(scale: float) -> None:
    made = MadeWithDefaults()
    made.drive("BATT_VOLT_MULT", scale, 10.1)
    made.table["BAT"]["Volt"] *= scale / 10.1
    finding = made.find()[0]
    assert finding.parameters == ("BATT_VOLT_MULT",)
    assert finding.wanted == (("BATT_VOLT_MULT", 10.1),)
    assert "the battery was not charged" not in [one.title for one in made.find()]


def test_a_scale_of_ones_own_that_reads_rightly_is_none() -> None:
    made = MadeWithDefaults()
    made.drive("BATT_VOLT_MULT", 18.0, 10.1)
    assert made.find() == ()


def test_a_drained_pack_stays_one_with_a_scale_of_ones_own() -> None:
    made = MadeWithDefaults()
    made.drive("BATT_VOLT_MULT", 12.0, 10.1)
    made.table["BAT"]["Volt"] -= 1.5
    assert made.find()[0].title == "the battery was not charged"


def test_a_pin_with_nothing_on_it() -> None:
    made = MadeWithDefaults()
    made.drive("BATT_VOLT_PIN", 14, 13)
    made.table["BAT"]["Volt"][:] = np.where(made.after(ARMED_S, DOWN_S), 4.4, 0.0) + made.noise(0.01)
    finding = naming(made, "BATT_VOLT_PIN")
    assert (finding.severity, finding.wanted) == ("warning", (("BATT_VOLT_PIN", 13.0),))
    fails_at(made, "Battery 1 is critical 4.41V used 84 mAh")
    assert naming(made, "BATT_VOLT_PIN").severity == "critical"


@pytest.mark.parametrize("offset", [-0.5, 0.5])
def test_a_current_before_the_motors_turn(offset: float) -> None:
    made = MadeWithDefaults()
    made.settings["BATT_AMP_PERVLT"] = 17.0
    made.table["BAT"]["Curr"] -= 0.5 + 17.0 * offset
    made.drive("BATT_AMP_OFFSET", offset, 0.0)
    assert naming(made, "BATT_AMP_OFFSET").wanted == (("BATT_AMP_OFFSET", 0.0),)


def test_a_monitor_without_what_a_failsafe_rests_on() -> None:
    made = MadeWithDefaults()
    made.drive("BATT_MONITOR", 0, 4)
    made.table.pop("BAT")
    finding = naming(made, "BATT_MONITOR")
    assert (finding.severity, finding.wanted) == ("warning", (("BATT_MONITOR", 4.0),))
    made.settings["BATT_LOW_VOLT"] = 0.0
    assert naming(made, "BATT_MONITOR").severity == "info"


@pytest.mark.parametrize(("level", "parameter"), [("low", "BATT_LOW_MAH"), ("critical", "BATT_CRT_MAH")])
def test_a_charge_that_was_kept_back_ended_the_flight(level: str, parameter: str) -> None:
    made = MadeWithDefaults()
    made.settings["BATT_CAPACITY"] = 3300
    made.drive(parameter, 3000, 0)
    fails_at(made, f"Battery 1 is {level} 11.70V used 301 mAh")
    finding = made.find()[0]
    assert (finding.parameters, finding.wanted, finding.suspect) == ((parameter,), (), "parameter")
    assert f"{parameter}=3000 (default 0) acted with 301 of 3300 mAh used" in finding.evidence
    assert "still held 11.7 V" in finding.evidence


def test_a_charge_that_was_used_is_no_parameters_fault() -> None:
    made = MadeWithDefaults()
    made.settings["BATT_CAPACITY"] = 3300
    made.drive("BATT_LOW_MAH", 700, 0)
    fails_at(made, "Battery 1 is low 11.10V used 2601 mAh")
    assert made.find()[0].title == "battery failsafe"


@pytest.mark.parametrize(("level", "parameter"), [("low", "BATT_LOW_VOLT"), ("critical", "BATT_CRT_VOLT")])
def test_a_voltage_above_what_a_full_pack_sags_to(level: str, parameter: str) -> None:
    made = MadeWithDefaults()
    made.drive(parameter, 11.8, 10.5 if level == "low" else 9.6)
    fails_at(made, f"Battery 1 is {level} 11.74V used 234 mAh")
    finding = made.find()[0]
    assert (finding.parameters, finding.wanted) == ((parameter,), ())
    assert f"{parameter}=11.8 (default" in finding.evidence

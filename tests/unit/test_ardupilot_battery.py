"""Packs, monitors and supplies."""

from __future__ import annotations

from care_core.diagnose.parts import is_pack
from care_core.ecosystems.findings import MONITOR_SILENT, NO_BATTERY, UNCHARGED
from tests.flights import ARMED_S, DOWN_S, FAILS_S, Made, first


def test_a_battery_that_was_not_charged() -> None:
    made = Made()
    made.table["BAT"]["Volt"] -= 1.5
    finding = first(made)
    assert finding.title == "the battery was only partly charged"
    assert (finding.kind, finding.severity) == ("battery", "warning")
    assert "3 cells" in finding.evidence
    assert finding.mission_lost == 0.05, "it held"
    made.rows["ERR"] = [(40.0, {"Subsys": 6.0, "ECode": 1.0})]
    assert (first(made).severity, first(made).mission_lost) == ("critical", None)


def test_a_battery_is_no_reason_for_a_refusal_that_names_another() -> None:
    made = Made()
    made.rows = {"MSG": [(t, {"Message": "PreArm: RC not found"}) for t in (20.0, 50.0, 80.0)]}
    made.table["BAT"]["Volt"][:] = 11.4 + made.noise(0.01)
    for name in ("CTUN", "POS"):
        made.table.pop(name)
    refusal, battery = made.find()
    assert (refusal.kind, battery.kind, battery.severity) == ("prearm", "battery", "info")


def test_a_failsafe_above_what_a_battery_needs_is_a_parameter() -> None:
    made = Made()
    made.settings["BATT_LOW_VOLT"] = 11.9
    made.rows["ERR"] = [(40.0, {"Subsys": 6.0, "ECode": 1.0})]
    finding = first(made)
    assert (finding.kind, finding.suspect) == ("battery", "parameter")
    assert "BATT_LOW_VOLT=11.9" in finding.evidence


def test_a_failsafe_of_a_monitor_that_measures_nothing_blames_no_threshold() -> None:
    made = Made()
    made.settings["BATT_LOW_VOLT"] = 9.0
    made.rows["ERR"] = [(40.0, {"Subsys": 6.0, "ECode": 1.0})]
    made.table["BAT"]["Volt"][:] = 3.248
    finding = first(made)
    assert (finding.title, finding.parameters) == (f"{NO_BATTERY}, and its failsafe acted", ())
    made.settings["BATT_FS_LOW_ACT"] = 0.0
    assert first(made).title == f"{NO_BATTERY}, and its failsafe was told"
    made.rows["MODE"].append((40.2, {"ModeNum": 9.0}))
    assert first(made).title == f"{NO_BATTERY}, and its failsafe acted"


def test_a_monitor_that_fell_silent_is_no_empty_battery() -> None:
    made = Made()
    made.rows["MSG"].append((ARMED_S - 2.0, {"Message": "Battery 1 is missing, last: 15.60V used 0 mAh"}))
    made.table["BAT"]["Volt"] -= float(made.table["BAT"]["Volt"][0]) - 3 * 3.88
    finding = first(made)
    assert (finding.title, finding.severity) == (MONITOR_SILENT, "warning")
    made.rows["MSG"].append((ARMED_S - 1.0, {"Message": "Battery Failsafe - Disarming"}))
    finding = first(made)
    assert (finding.title, finding.severity) == (MONITOR_SILENT, "critical")
    assert not is_pack(finding)
    assert UNCHARGED not in {one.title for one in finding.below}


def test_of_a_battery_that_was_not_full_it_is_none() -> None:
    made = Made()
    made.settings["BATT_LOW_VOLT"] = 11.9
    made.rows["ERR"] = [(40.0, {"Subsys": 6.0, "ECode": 1.0})]
    made.table["BAT"]["Volt"] -= float(made.table["BAT"]["Volt"][0]) - 3 * 4.03
    finding = first(made)
    assert (finding.title, finding.suspect) == ("battery failsafe", "operation")
    assert "not full before take-off: 4.03 V a cell" in finding.evidence


def test_a_sagging_battery() -> None:
    made = Made()
    made.table["BAT"]["Volt"][made.after(FAILS_S, DOWN_S)] = 8.7
    assert first(made).title == "the battery sags under its load"
    assert first(made).severity == "critical"
    assert first(made).probability > 0.5, "a charged pack lasts longer"
    assert "down to 8.7 V over 2 s, 2.90 V for each of 3 cells" in first(made).evidence


def test_a_board_that_loses_its_supply() -> None:
    made = Made()
    made.table["POWR"]["Vcc"][made.after(FAILS_S, FAILS_S + 3)] = 4.1
    assert first(made).title == "the autopilot's own supply dips"


def test_a_supply_that_is_low_all_along_does_not_dip_and_is_no_battery() -> None:
    made = Made()
    made.table["POWR"]["Vcc"] = made.table["POWR"]["Vcc"] - 0.75
    finding = first(made)
    assert (finding.title, finding.severity) == ("the autopilot's own supply is low", "warning")
    assert not is_pack(finding)


def test_a_monitor_that_does_not_move() -> None:
    made = Made()
    made.table["BAT"]["Volt"][:] = 12.0
    assert (first(made).kind, first(made).severity) == ("battery", "info")


def test_a_simulated_battery_and_computer_are_nobodys_business() -> None:
    made = Made()
    made.settings["SIM_BATT_VOLTAGE"] = 12.6
    made.table["BAT"]["Volt"][:] = 12.6
    made.table["PM"]["NLon"][made.after(FAILS_S)] = 1500
    assert made.find() == ()


def test_the_noise_of_a_monitor_is_no_cell_more() -> None:
    made = Made()
    made.settings.pop("MOT_BAT_VOLT_MAX")
    made.table["BAT"]["Volt"] += 12 * 4.2 - made.table["BAT"]["Volt"][0]
    assert "the battery was only partly charged" not in [one.title for one in made.find()]
    made.table["BAT"]["Volt"] += made.noise(1.0)
    assert "the battery was only partly charged" not in [one.title for one in made.find()]

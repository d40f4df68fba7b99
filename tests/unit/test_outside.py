"""Suspects among the parameters that no profile models: what is off, what it does, and what is advised of it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import care_core
from care_core.application.case import Case
from care_core.application.deciding import predict
from care_core.diagnose.outside.change import (
    Advisable,
    asked_beside,
    check_first,
    leading_outside,
    outside_fix,
    outside_option,
    shown_fix,
)
from care_core.diagnose.outside.off import off_parameters
from care_core.diagnose.outside.signs import Signs, signs_of
from care_core.diagnose.outside.suspects import outside_suspects, phases_of
from care_core.diagnose.records import Hypothesis, ObjectiveResult, OutsideSuspect, first_named
from care_core.diagnose.verdict import verdict_of
from care_core.ecosystems.findings import NOTHING_SEEN, Event, Finding, FindingKind, Health
from care_core.ecosystems.vehicles.vehicle import Vehicle
from care_core.errors import CareError, ConfigError
from care_core.metadata.causal_map import FROM_FLIGHTS, OF_THIS_VEHICLE
from care_core.metadata.screening import flights_of, plain_refusal, screened
from care_core.profile.store import load_profile
from care_core.records import replace
from care_core.report.document import ChangeEntry, FixSet
from care_core.report.suggested import suggested_changes
from care_core.run import Setting
from tests.made import TIME, made_run

COPTER = Vehicle("copter", "quad X", "ArduCopter V4.5.4", (4, 5, 4))
SLOW_HOME = Signs(frozenset({"slow_rtl"}), frozenset({"slow_rtl", "costly"}))
EVERYTHING = frozenset({"always", "arming", "takeoff", "navigation", "hold", "rtl", "land", "battery"})


def setting(name: str, value: float, default: float | None = None) -> dict[str, Setting]:
    return {name: Setting(name, value, "PARM", default)}


def suspects(settings: dict[str, Setting], signs: Signs, good: dict[str, Setting] | None = None) -> dict[str, float]:
    off = off_parameters(settings, COPTER, (), good)
    return {one.name: one.weight for one in outside_suspects(off, signs, EVERYTHING, "copter")}  # type: ignore[arg-type]


def test_what_lost_no_flight_is_told_where_a_limit_is_missed_that_it_acts_on() -> None:
    """The value was flown and kept its limit, which does not say by how much: PSC_VEL_D of a rover."""
    rover = replace(COPTER, kind="rover")
    strays = Signs(frozenset({"strays"}), frozenset({"strays"}))
    driven = {**setting("PSC_VEL_D", 1, 0), **setting("MOT_SPD_SCA_BASE", 0.1, 1)}
    found = outside_suspects(off_parameters(driven, rover, (), None), strays, EVERYTHING, "rover")  # type: ignore[arg-type]
    assert [(one.name, one.is_learned) for one in found] == [("PSC_VEL_D", False), ("MOT_SPD_SCA_BASE", False)]
    assert sum(one.weight for one in found) == pytest.approx(0.02)
    upset = Signs(frozenset({"upset"}), frozenset({"upset", "strays"}))
    assert not outside_suspects(off_parameters(driven, rover, (), None), upset, EVERYTHING, "rover")  # type: ignore[arg-type]


def test_a_parameter_that_nothing_knows_does_not_hide_the_first_that_is_named() -> None:
    unknown, named = Hypothesis("parameter", "", 0.5), Hypothesis("parameter", "PSC_VEL_D", 0.4)
    assert first_named((unknown, named)) == named
    assert first_named((unknown,)) is None


PX4_QUAD = Vehicle("px4", "quad", "PX4 v1.15.4", (1, 15, 4))


def test_a_px4_parameter_is_held_against_its_airframe_and_known_by_its_part() -> None:
    driven = {**setting("SENS_BOARD_ROT", 4, 0), **setting("SENS_BOARD_X_OFF", 1e-6, 0), **setting("CAL_MAG0_ID", 7, 0)}
    (off,) = off_parameters(driven, PX4_QUAD, (), None)
    assert (off.name, off.meaning.part, off.meaning.role, off.is_code) == (
        "SENS_BOARD_ROT", "board orientation", "wiring", True,
    )  # fmt: skip
    assert not list(off_parameters({**setting("MPC_XY_TRAJ_P", 0.9)}, PX4_QUAD, (), None))  # no default in the log
    option = outside_option("MIS_TAKEOFF_ALT", 2.5, PX4_QUAD)
    assert (option.unit, option.range) == ("m", None)


def test_a_rotor_that_the_vehicle_has_none_of_is_no_suspect() -> None:
    driven = {**setting("CA_ROTOR_COUNT", 4, 0), **setting("CA_ROTOR3_AX", 0.5, 0), **setting("CA_ROTOR4_AX", 0.5, 0)}
    assert "CA_ROTOR4_AX" not in [one.name for one in off_parameters(driven, PX4_QUAD, (), None)]
    assert "CA_ROTOR3_AX" in [one.name for one in off_parameters(driven, PX4_QUAD, (), None)]


def test_a_parameter_at_its_default_is_not_off() -> None:
    assert not list(off_parameters(setting("RTL_LOIT_TIME", 5000, 5000), COPTER, (), None))


def test_a_log_without_defaults_is_held_against_the_firmwares() -> None:
    (off,) = off_parameters(setting("RTL_LOIT_TIME", 60000), COPTER, (), None)
    assert (off.value, off.default, off.back) == (60000, 5000, 5000)
    old = replace(COPTER, version=(3, 6, 0))
    assert not list(off_parameters(setting("RTL_LOIT_TIME", 60000), old, (), None))


@pytest.mark.parametrize(
    "name", ["STAT_RUNTIME", "INS_GYR2OFFS_X", "COMPASS_DEV_ID", "SIM_WIND_SPD", "NTF_LED_BRIGHT", "COMPASS_PRIO1_ID"]
)
def test_what_nobody_chose_and_what_moves_nothing_is_no_suspect(name: str) -> None:
    assert not list(off_parameters(setting(name, 3.0, 1.0), COPTER, (), None))


def test_options_of_the_profile_are_left_to_it() -> None:
    assert not list(off_parameters(setting("LAND_SPEED", 16, 50), COPTER, {"LAND_SPEED"}, None))


def test_what_changed_since_the_good_run_goes_back_to_its_value() -> None:
    good = setting("RTL_LOIT_TIME", 8000, 5000)
    (off,) = off_parameters(setting("RTL_LOIT_TIME", 60000, 5000), COPTER, (), good)
    assert off.is_changed
    assert off.back == 8000
    (same,) = off_parameters(good, COPTER, (), good)
    assert same.is_changed is False


def test_a_value_whose_flights_failed_in_this_way_is_a_suspect() -> None:
    assert any(flight.is_lost for flight in flights_of("RTL_LOIT_TIME", "copter"))
    assert suspects(setting("RTL_LOIT_TIME", 60000, 5000), SLOW_HOME)["RTL_LOIT_TIME"] > 0.5


def test_a_run_that_failed_in_another_way_clears_it() -> None:
    tipped = Signs(frozenset({"tipped"}), frozenset({"tipped", "upset"}))
    assert not suspects(setting("RTL_LOIT_TIME", 60000, 5000), tipped)


def test_a_parameter_that_no_phase_of_the_run_read_is_none() -> None:
    off = list(off_parameters(setting("RTL_LOIT_TIME", 60000, 5000), COPTER, (), None))
    assert outside_suspects(off, SLOW_HOME, frozenset({"always", "navigation"}), "copter") == ()


def test_a_harmless_value_is_next_to_nothing() -> None:
    assert "RTL_LOIT_TIME" not in suspects(setting("RTL_LOIT_TIME", 6000, 5000), SLOW_HOME)


def test_a_good_run_with_the_same_value_clears_it_and_a_change_accuses() -> None:
    driven = setting("RTL_LOIT_TIME", 30000, 5000)
    alone = suspects(driven, SLOW_HOME)["RTL_LOIT_TIME"]
    assert suspects(driven, SLOW_HOME, setting("RTL_LOIT_TIME", 5000))["RTL_LOIT_TIME"] > alone
    assert suspects(driven, SLOW_HOME, setting("RTL_LOIT_TIME", 30000)).get("RTL_LOIT_TIME", 0.0) < 0.1 * alone


def test_only_the_same_refusal_accuses() -> None:
    text = plain_refusal("SERVO2_MAX is less than SERVO2_TRIM")
    same = Signs(frozenset({"refused"}), frozenset({"refused"}), frozenset({text}))
    other = replace(same, refusals=frozenset({plain_refusal("Need 3D Fix")}))
    driven = setting("SERVO2_MAX", 800, 1900)
    assert suspects(driven, same)["SERVO2_MAX"] > 0.5
    assert "SERVO2_MAX" not in suspects(driven, other)


def test_wiring_among_much_other_wiring_is_off_for_good_reasons() -> None:
    text = frozenset({plain_refusal("SERVO2_MAX is less than SERVO2_TRIM")})
    signs = Signs(frozenset({"refused"}), frozenset({"refused"}), text)
    driven = setting("SERVO2_MAX", 800, 1900)
    names = ("GPS_TYPE2", "COMPASS_ORIENT", "FRAME_CLASS", "SERIAL3_PROTOCOL", "RNGFND1_TYPE")
    others = {name: Setting(name, 2.0, "PARM", 0.0) for name in names}
    assert suspects(driven | others, signs)["SERVO2_MAX"] < 0.5 * suspects(driven, signs)["SERVO2_MAX"]


@given(st.sets(st.sampled_from(["LOIT_SPEED", "PHLD_BRAKE_RATE", "ACRO_RP_RATE", "CIRCLE_RATE", "FLTMODE3"])))
def test_parameters_of_modes_that_were_not_flown_change_nothing(names: set[str]) -> None:
    driven = setting("RTL_LOIT_TIME", 60000, 5000)
    others = {name: Setting(name, 77.0, "PARM", 10.0) for name in names}
    assert suspects(driven | others, SLOW_HOME) == suspects(driven, SLOW_HOME)


def test_the_phases_of_a_run_come_from_its_mission_and_its_switches() -> None:
    run = made_run()
    assert "navigation" not in phases_of(run, has_begun=False)
    flown = replace(run, mission=replace(run.mission, asked=(("returns", 1.0),)), modes=("Auto", "Loiter"))
    assert {"navigation", "rtl", "land", "manual"} <= phases_of(flown, has_begun=True)
    fenced = replace(flown, settings=setting("FENCE_ENABLE", 1))
    assert "fence" in phases_of(fenced, has_begun=True)


def test_the_first_sign_is_what_failed_first_and_a_failsafe_of_the_firmware() -> None:
    tipped = Finding("takeoff", "it tipped over at take-off", 5.0, 9.0, "critical", "", "ATT")
    health = Health("", (Event(6.0, "failsafe", "EKF failsafe", "ERR"),), (tipped,))
    late = ObjectiveResult(TIME, 190.0, TIME.threshold, "fault")
    signs = signs_of(made_run(), [late], health)
    assert signs.first == {"tipped", "failsafe_estimator"}
    assert signs_of(made_run(), [late], NOTHING_SEEN).first == {"slow_cruise"}


ROVER = {"firmware": "ArduRover V4.5.4", "vehicle": "rover"}


def test_a_rover_has_no_phases_but_its_way() -> None:
    run = made_run()
    driven = replace(run, log=replace(run.log, facts=ROVER), shortfall=("0 of 3 waypoints were reached",))
    assert signs_of(driven, [], NOTHING_SEEN).every == {"stuck"}
    assert "no_takeoff" in signs_of(replace(driven, log=run.log), [], NOTHING_SEEN).every
    late = ObjectiveResult(TIME, 190.0, TIME.threshold, "fault")
    profile = load_profile("ardurover")
    assert signs_of(made_run(), [late], NOTHING_SEEN, profile.schema, object()).first == {"slow_cruise"}  # type: ignore[arg-type]


def test_what_a_rover_does_the_wrong_way_round_is_straying_and_a_wait_is_no_progress() -> None:
    for title, sign in (
        ("it turns against its steering", "strays"),
        ("the trim of the right wheels is not its middle", "strays"),
        ("the tightest turn is not TURN_RADIUS", "strays"),
        ("an output ends before what it is asked for", "stuck"),
        ("it waits to be set off", "stuck"),
    ):
        health = Health("", (), (Finding("drive", title, 0.0, 9.0, "critical", "", "THR"),))
        assert signs_of(made_run(), [], health).first == {sign}


def test_a_value_that_all_flights_had_is_harmless() -> None:
    reference = flights_of("COMPASS_OFS_X", "rover")[0].reference
    off = off_parameters(setting("COMPASS_OFS_X", reference, 0.0), replace(COPTER, kind="rover"), (), None)
    strays = Signs(frozenset({"strays"}), frozenset({"strays"}))
    assert all(one.weight < 0.03 for one in outside_suspects(off, strays, EVERYTHING, "rover"))  # type: ignore[arg-type]


def test_a_refusal_is_known_by_what_was_said_alone() -> None:
    said = "SERVO1_MAX is less than SERVO1_TRIM; SERVO1_MAX is 800 (default 2000)"
    health = Health("", (), (Finding("prearm", "arming was refused", 0.0, 9.0, "critical", said, "MSG"),))
    assert signs_of(made_run(), [], health).refusals == {"servo#_max is less than servo#_trim"}


def named(name: str, *wanted: tuple[str, float]) -> Finding:
    return Finding("battery", f"{name} is wrong", 0.0, 9.0, "critical", "", "BAT", parameters=(name,), wanted=wanted)


def lead(name: str, value: float, findings: list[Finding], suspect: OutsideSuspect | None = None) -> object:
    run = replace(made_run(), settings=setting(name, value, 1.0))
    ranked = [Hypothesis("parameter", name, 0.7), Hypothesis("chance", "", 0.3)]
    return leading_outside(ranked, [suspect] if suspect else [], findings, run)


def test_a_measured_value_is_advised() -> None:
    found = lead("BATT_VOLT_MULT", 8.2, [named("BATT_VOLT_MULT", ("BATT_VOLT_MULT", 10.1))])
    assert found is not None
    assert (found.is_advised, found.wanted) == (True, 10.1)  # type: ignore[attr-defined]


def test_what_else_a_finding_asks_for_goes_with_a_refusal() -> None:
    run = replace(made_run(), settings={**setting("RNGFND1_TYPE", 47.0, 0.0), **setting("SERVO3_TRIM", 1562.0, 1500.0)})
    creeps = named("SERVO3_TRIM", ("SERVO3_TRIM", 1500.0))
    (change,) = asked_beside([creeps, replace(creeps, severity="warning")], run, {"RNGFND1_TYPE"})
    assert (change.option.name, change.current, change.suggested) == ("SERVO3_TRIM", 1562.0, 1500.0)
    assert not asked_beside([replace(creeps, severity="warning")], run, ())


def test_what_flights_lost_is_advised_but_a_calibration_is_looked_at() -> None:
    choice = OutsideSuspect("RTL_LOIT_TIME", 60000, 5000, 0.8, "choice", True, "RTL_LOIT_TIME 60000 (default 5000)")
    assert lead("RTL_LOIT_TIME", 60000, [], choice).is_advised  # type: ignore[attr-defined]
    offset = OutsideSuspect("INS_ACCOFFS_X", 3.5, 0.0, 0.8, "calibration", True, "")
    found = lead("INS_ACCOFFS_X", 3.5, [], offset)
    assert not found.is_advised  # type: ignore[attr-defined]
    assert check_first(found) == "check first INS_ACCOFFS_X 3.5 (default 0)"  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["BATT_LOW_MAH", "FENCE_RADIUS", "ARMING_CHECK", "FS_EKF_THRESH"])
def test_what_protects_is_never_put_back_by_advice(name: str) -> None:
    suspect = OutsideSuspect(name, 3200, 0.0, 0.9, "safety", True, "")
    found = lead(name, 3200, [named(name, (name, 0.0))], suspect)
    assert found is not None
    assert not found.is_advised  # type: ignore[attr-defined]


def test_a_parameter_outside_becomes_an_option_with_what_is_documented() -> None:
    option = outside_option("RTL_ALT_FINAL", 0.0, COPTER)
    assert (option.unit, option.parameters, option.safety) == ("cm", ("RTL_ALT_FINAL",), False)
    assert outside_option("BATT_LOW_MAH", 0.0, COPTER).safety


def entry(option: str, value: float) -> FixSet:
    change = ChangeEntry(option=option, parameter=option, from_=1.0, to=value, reboot_required=False)
    return FixSet(changes=[change], p_fixed=0.5, predicted={})


def test_a_report_sets_what_an_operator_chooses_and_no_wiring_or_protection() -> None:
    schema = load_profile("arducopter").schema
    (change,) = suggested_changes(entry("RTL_LOIT_TIME", 5000), schema, Path("r"), "fix")
    assert change.option.parameters == ("RTL_LOIT_TIME",)
    for name in ("FRAME_CLASS", "SERVO1_FUNCTION", "SERVO1_TRIM", "COMPASS_ORIENT", "SCR_USER1"):
        with pytest.raises(ConfigError, match="wired or calibrated, which no report sets"):
            suggested_changes(entry(name, 1.0), schema, Path("r"), "fix")
    for name in ("BATT_LOW_MAH", "ARMING_CHECK", "NO_SUCH", "a b"):
        for roles in (FROM_FLIGHTS, FROM_FLIGHTS | OF_THIS_VEHICLE):
            with pytest.raises(ConfigError, match="cannot be acted on"):
                suggested_changes(entry(name, 1.0), schema, Path("r"), "fix", roles)


def test_a_calibration_that_was_advised_can_be_verified_and_not_applied() -> None:
    schema = load_profile("ardurover").schema
    (change,) = suggested_changes(
        entry("SERVO1_TRIM", 1500.0), schema, Path("r"), "fix", FROM_FLIGHTS | OF_THIS_VEHICLE
    )
    assert (change.option.name, change.value) == ("SERVO1_TRIM", 1500.0)


@pytest.fixture(scope="module")
def slow_home(recorded: Path) -> Case:
    return care_core.triage(recorded / "data/anyparam/a5501_09_04.BIN")


def test_a_flight_that_a_parameter_outside_lost_is_answered_by_it(slow_home: Case) -> None:
    diagnosis = slow_home.diagnosis
    assert diagnosis.hypotheses[0].name == "RTL_LOIT_TIME"
    assert diagnosis.fix is not None
    assert [str(change) for change in diagnosis.fix.changes] == ["RTL_LOIT_TIME 60000 -> 5000"]
    text = slow_home.report()
    assert "param set RTL_LOIT_TIME 5000" in text
    assert json.loads(slow_home.report("json"))["outside"][0]["name"] == "RTL_LOIT_TIME"
    assert "RTL_LOIT_TIME" in str(verdict_of(diagnosis).reasons[0])


def test_what_it_promises_is_asked_alone_or_not_at_all(slow_home: Case) -> None:
    assert predict(slow_home, {"RTL_LOIT_TIME": 5000.0}) == slow_home.diagnosis.fix
    with pytest.raises(CareError, match="RTL_LOIT_TIME"):
        predict(slow_home, {"RTL_LOIT_TIME": 5000.0, "WPNAV_SPEED": 900.0})


def test_a_protection_that_acted_early_is_looked_at_first(recorded: Path) -> None:
    diagnosis = care_core.triage(recorded / "data/anyparam/a5501_10_00.BIN").diagnosis
    assert diagnosis.fix is None
    assert diagnosis.abstained is not None
    assert diagnosis.abstained.startswith("check first BATT_CRT_MAH 3000")


def test_options_that_stand_beside_it_are_changed_with_it(recorded: Path) -> None:
    diagnosis = care_core.triage(recorded / "data/anyparam/a5501_04_07.BIN").diagnosis
    assert diagnosis.fix is not None
    assert {change.option.name for change in diagnosis.fix.changes} == {"LAND_ALT_LOW", "PSC_VELXY_P"}


def test_flights_that_failed_alike_are_told_by_the_nearest_values() -> None:
    texts = {value: outside_text("TKOFF_RPM_MIN", value, "tipped") for value in (5781.0, 10000.0)}
    assert texts[10000.0].endswith("simulated flights with it at 10000 failed in this way")
    assert "with it at 200, 1000 and 10000" in texts[5781.0]


def outside_text(name: str, value: float, sign: str) -> str:
    signs = Signs(frozenset({sign}), frozenset({sign, "no_takeoff", "stuck"}))  # type: ignore[arg-type]
    off = off_parameters(setting(name, value, 0.0), COPTER, (), None)
    (found,) = outside_suspects(off, signs, EVERYTHING, "copter")  # type: ignore[arg-type]
    return found.text


def test_its_fix_has_the_notes_of_its_documentation() -> None:
    found = lead("GPS_TYPE2", 19, [named("GPS_TYPE2", ("GPS_TYPE2", 0.0))])
    fix = outside_fix(found, 0.7, made_run())  # type: ignore[arg-type]
    assert fix.changes[0].notes == ("takes effect after a reboot",)


def test_how_a_vehicle_is_built_its_operator_knows() -> None:
    found = lead("FRAME_TYPE", 19, [named("FRAME_TYPE", ("FRAME_TYPE", 0.0))])
    assert not found.is_advised  # type: ignore[attr-defined]
    unknown = lead("FRAME_CLASS", 14, [named("FRAME_CLASS")])
    assert check_first(unknown) == "what is found comes first: FRAME_CLASS is wrong"  # type: ignore[arg-type]
    other = replace(named("FRAME_CLASS"), title="outputs of motors are driven as servos")
    said = check_first(lead("FRAME_CLASS", 14, [other]))  # type: ignore[arg-type]
    assert said == "check first FRAME_CLASS 14: outputs of motors are driven as servos"


def test_no_screening_flight_was_flown_at_the_reference() -> None:
    """It would tell nothing of a value that is off, and of how far that is on the way there."""
    for kind in ("copter", "plane", "rover", "px4"):
        assert not [name for name in screened(kind) for one in flights_of(name, kind) if one.value == one.reference]


def test_the_value_that_every_screening_flight_had_is_harmless() -> None:
    tipped = Signs(frozenset({"tipped"}), frozenset({"tipped", "upset"}))
    assert "FRAME_TYPE" not in suspects(setting("FRAME_TYPE", 1, 0), tipped)
    assert "FRAME_TYPE" in suspects(setting("FRAME_TYPE", 13, 0), tipped)


def test_what_the_log_shows_is_changed_without_odds_where_no_objective_could_be_judged() -> None:
    lead = Advisable(
        "SERVO3_MAX", 1620.0, 2000.0, "should be 2000", 0.67, "an output ends", is_found=True, is_advised=True
    )
    run = made_run()
    rover = replace(run, log=replace(run.log, facts=ROVER))
    found = [ended("SERVO3_MAX", 2000.0)]
    fix = shown_fix(lead, rover, found)
    assert fix is not None
    assert [(one.option.name, one.suggested) for one in fix.changes] == [("SERVO3_MAX", 2000.0)]
    assert fix.odds is None
    for other in (None, replace(lead, is_found=False), replace(lead, is_advised=False)):
        assert shown_fix(other, rover, found) is None


def ended(name: str, wanted: float, kind: FindingKind = "tuning") -> Finding:
    return Finding(kind, f"{name} ends", 0.0, 9.0, "critical", "", "RCOU", parameters=(name,), wanted=((name, wanted),))


def test_what_was_set_wrong_in_the_same_way_goes_back_with_it_from_where_it_was_left() -> None:
    """Of two motors that were switched off in flight both are switched on again, though the run began with them on."""
    on, off = Setting("SERVO2_FUNCTION", 34, "log"), Setting("SERVO2_FUNCTION", 1, "log", changed_at_s=17.0)
    named = ("SERVO2_FUNCTION", "SERVO4_FUNCTION", "SERVO3_MAX")
    run = replace(
        made_run(),
        settings={name: replace(on, name=name) for name in named},
        changes={name: (replace(on, name=name), replace(off, name=name)) for name in named[:2]},
    )
    lead = Advisable(named[0], 1.0, 34.0, "", 0.8, "it was changed in flight", is_found=True, is_advised=True)
    found = [ended(named[0], 34.0), ended(named[1], 36.0), ended(named[2], 2000.0, "battery")]
    fix = shown_fix(lead, run, found)
    assert fix is not None
    assert [(one.option.name, one.current, one.suggested) for one in fix.changes] == [
        ("SERVO2_FUNCTION", 1.0, 34.0),
        ("SERVO4_FUNCTION", 1.0, 36.0),
    ]


def test_a_value_on_the_side_that_nobody_flew_counts_by_how_far_it_is_off() -> None:
    """The offsets of a compass that is calibrated: of a plane -400 was flown, and lost."""
    (flown,) = flights_of("COMPASS_OFS_Y", "plane")
    assert flown.is_lost
    assert flown.value == -400.0
    plane = Vehicle("plane", "fixed wing", "ArduPlane V4.5.4", (4, 5, 4))
    strayed = Signs(frozenset({"strays"}), frozenset({"strays"}))

    def weight(value: float) -> float:
        off = list(off_parameters(setting("COMPASS_OFS_Y", value, 0.0), plane, (), None))
        found = outside_suspects(off, strayed, EVERYTHING, "plane")  # type: ignore[arg-type]
        return sum(one.weight for one in found)

    assert weight(13.0) < 0.05
    assert weight(390.0) > 5 * weight(13.0)

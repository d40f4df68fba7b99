"""What to do next: nothing that lost thrust, crashed or was upset runs its mission again at once."""

from __future__ import annotations

import pytest

import care_core
from care_core.application.case import Request
from care_core.diagnose.next_step import bench, next_step, trial, was_upset
from care_core.diagnose.records import Diagnosis, Hypothesis
from care_core.diagnose.verdict import verdict_of
from care_core.ecosystems.findings import (
    IDLED,
    KILLED,
    NOT_FLOWN,
    STEERED,
    STOPPED,
    TOO_SHORT,
    Finding,
    FindingKind,
    Health,
    Severity,
)
from care_core.files import bundled
from care_core.records import replace
from care_core.report.document import build_document, remembered_verdict
from care_core.report.reading import remembered
from care_core.report.terminal import to_text
from care_core.report.writers import published
from care_core.run import Damage, Evidence, OutcomeCheck, Setting
from tests.made import made_diagnosis, made_run

AGAIN = "run the same configuration again: if it fails again, the cause persists"
THRUST = Finding("thrust", "too little thrust", 50.0, 60.0, "critical", "", "", probability=0.3)
LATE = Finding("cpu", "the loop is late", 50.0, 60.0, "warning", "", "")


def failed(*findings: Finding, fixed: bool = False) -> Diagnosis:
    made = made_diagnosis()
    return replace(
        made, fix=made.fix if fixed else None, health=Health("", (), findings), hypotheses=(), tell_more=(AGAIN,)
    )


@pytest.mark.parametrize("kind", ["attitude", "crash", "motor", "takeoff", "thrust"])
def test_after_an_upset_comes_the_bench_the_simulator_or_a_hover(kind: str) -> None:
    upset = replace(THRUST, kind=kind, suspect="parameter")
    said = next_step(failed(upset), has_failed=True)
    assert "bench" in said
    assert "in the simulator or a low hover" in said
    assert "again" not in said
    assert "try it in the simulator or a low hover first" in next_step(failed(upset, fixed=True), has_failed=True)


def test_messages_and_checks_tell_of_an_upset_as_well() -> None:
    run = replace(made_run(), evidence=())
    assert not was_upset(run, [LATE])
    assert was_upset(replace(run, evidence=(Evidence(60.0, "Potential Thrust Loss (3)", "thrust"),)), ())
    assert was_upset(
        replace(run, checks=(OutcomeCheck("no_crash", 0.0, "no crash", "the failure detector acted"),)), ()
    )


def test_a_run_that_failed_with_a_warning_alone_is_sent_after_what_that_calls_for() -> None:
    lost = Finding("radio", "the ground station link was lost", 31.8, 32.5, "warning", "", "", "world", 0.3)
    told = replace(failed(lost), tell_more=(), hypotheses=(Hypothesis("chance", "", 0.7),))
    assert next_step(told, has_failed=True).startswith("check the link's antennas and range")


def test_what_was_not_upset_runs_again() -> None:
    assert next_step(failed(LATE), has_failed=True) == AGAIN
    assert "run again" in next_step(failed(LATE, fixed=True), has_failed=True)
    assert next_step(failed(LATE), has_failed=False) == ""


def test_a_part_that_failed_is_what_to_look_at_whatever_explains_more() -> None:
    said = next_step(failed(THRUST), has_failed=True)
    assert said.startswith("check the propellers, motors and the battery under load")
    assert said.endswith("; then try it in the simulator or a low hover")
    laser = Finding("laser", "the laser falls silent", 50.0, 60.0, "critical", "", "", probability=0.9)
    said = next_step(failed(laser), has_failed=True)
    assert said == "check the laser's cable and supply, and its driver's log"


@pytest.mark.parametrize(
    ("kind", "title", "told"),
    [
        ("motor", "motor 4 (rear right) gave too little thrust", "check motor 4 (rear right): its propeller, ESC"),
        ("surface", "the elevator is at the stop, and the pitch does not follow", "check the elevator: servo"),
        ("surface", "the ailerons no longer obey", "look at the ailerons: a servo that stuck"),
        ("gps", "only 5 satellites", "wait under open sky for more satellites before arming"),
        ("gps", "the GPS position jumps by 28 m", "look at the GPS antenna: its view of the sky"),
        ("vibration", "strong vibration (51 m/s^2)", "balance or change the propellers"),
        ("drive", "the drive does not answer its commands", "check the emergency stop, the motor driver's fault light"),
        ("localisation", "odometry drifts: its position and its speed disagree", "check wheel radius"),
        ("software", "bt_navigator: it ended", "look at what this names: bt_navigator: it ended"),
        ("software", "left_mission: [ERROR] Mission failed!", "look at what left_mission said before that"),
        (
            "estimator",
            "the estimated climb rate runs away from the barometer's",
            "see what barometer and accelerometers",
        ),
        ("takeoff", "it tipped over at take-off", "see that it stands level and free"),
        ("software", "Position was asked for, and no position is known", "give it a source of position"),
    ],
)
def test_each_kind_of_finding_has_an_advice_of_its_own(kind: FindingKind, title: str, told: str) -> None:
    part = Finding(kind, title, 50.0, 60.0, "critical", "", "", probability=0.9)
    assert next_step(failed(part), has_failed=True).startswith(told)


def test_in_a_simulation_no_part_is_mended_and_no_hover_comes_first() -> None:
    part = Finding("motor", "motor 4 gave too little thrust", 50.0, 60.0, "critical", "", "", probability=0.9)
    made, fixed = failed(part), failed(part, fixed=True)
    settings = {**made.run.settings, "SIM_ENGINE_FAIL": Setting("SIM_ENGINE_FAIL", 8.0, "the log")}
    simulated = replace(made.run, settings=settings)
    said = next_step(replace(made, run=simulated), has_failed=True)
    assert said.endswith("was set in the simulator, or at its model: motor 4 gave too little thrust; then run again")
    assert "make the change, run again, and" in next_step(replace(fixed, run=simulated), has_failed=True)
    board = replace(made.run, settings=settings, log=replace(made.run.log, facts={"stack": "PX4", "hardware": "V5"}))
    assert "low hover" in next_step(replace(made, run=board), has_failed=True)


@pytest.mark.parametrize("sample", ["arduplane_elevator.BIN", "nav2_stall.mcap"])
def test_what_is_mended_first_does_not_run_again_before(sample: str) -> None:
    diagnosis = care_core.triage(bundled("samples", sample)).diagnosis
    assert diagnosis.abstained
    assert diagnosis.tell_more == ()


def test_telemetry_of_a_px4_vehicle_is_no_log_of_it() -> None:
    made = failed()
    log = replace(made.run.log, format="mavlink-tlog", facts={"stack": "PX4"})
    unfit = replace(made.profile, fit=replace(made.profile.fit, verdict="no"))
    heard = replace(made, run=replace(made.run, log=log), profile=unfit)
    assert next_step(heard, has_failed=False).startswith("triage the .ulg that the vehicle itself wrote")
    assert "what each profile would need" in next_step(replace(heard, run=made.run), has_failed=False)


def test_a_failed_run_that_no_profile_fits_is_told_what_to_do_about_its_gravest_finding() -> None:
    estimator = Finding("estimator", "the estimator rejects its measurements", 5.0, 9.0, "critical", "", "")
    made = replace(failed(estimator), tell_more=())
    unfit = replace(made, profile=replace(made.profile, fit=replace(made.profile.fit, verdict="no")))
    assert next_step(unfit, has_failed=True).startswith("find which measurement it rejects")


@pytest.mark.parametrize(
    ("why", "told"),
    [(NOT_FLOWN, "in which the vehicle was armed"), (TOO_SHORT, "'care record PROFILE' what to record")],
)
def test_what_holds_no_run_is_not_sent_after_profiles(why: str, told: str) -> None:
    made = failed()
    unfit = replace(made.profile, fit=replace(made.profile.fit, verdict="no"))
    sound = replace(made.run, log=replace(made.run.log, damage=()))
    short = replace(made, profile=unfit, run=sound, health=replace(made.health, too_little=why))
    said = next_step(short, has_failed=False)
    assert told in said
    assert "profile would need" not in said


def test_a_damaged_log_of_which_too_little_is_left_is_copied_again() -> None:
    made = failed()
    unfit = replace(made.profile, fit=replace(made.profile.fit, verdict="no"))
    cut = replace(made.run, log=replace(made.run.log, damage=(Damage("cut in a record", 4),)))
    short = replace(made, profile=unfit, run=cut, health=replace(made.health, too_little=TOO_SHORT))
    assert next_step(short, has_failed=False).startswith("copy the log from the vehicle again")
    sorted_by_time = replace(cut, log=replace(cut.log, damage=(Damage("messages were sorted", is_whole=True),)))
    assert "'care inspect LOG' shows what" in next_step(replace(short, run=sorted_by_time), has_failed=False)


def test_a_profile_that_was_named_and_does_not_fit_gives_way_to_the_one_that_does() -> None:
    case = care_core.triage(Request(bundled("samples", "arducopter_failed.BIN"), "nav2"))
    assert next_step(case.diagnosis, has_failed=False) == "take profile arducopter, which fits this log"


def test_what_drives_is_tried_at_walking_pace() -> None:
    run = made_run()
    rover = replace(run, log=replace(run.log, facts={"firmware": "ArduRover V4.5.4", "vehicle": "rover"}))
    drive = replace(run, log=replace(run.log, format="mcap"))
    assert trial(rover) == trial(drive) == "in the simulator or at walking pace"
    assert "wheels" in bench(rover)
    assert "propellers" in bench(run)


def test_no_motor_is_checked_for_a_height_that_was_estimated_wrongly() -> None:
    height = Finding("estimator", "the estimated height runs away", 40.0, 60.0, "critical", "", "", probability=0.9)
    named = replace(failed(height, THRUST), hypotheses=(Hypothesis("hardware", height.title, 0.9),))
    said = next_step(replace(named, health=Health("", (), (replace(height, followed_by=(THRUST,)),))), has_failed=True)
    assert said.startswith("see what barometer and accelerometers read while it stands")
    assert "motor" not in said


@pytest.mark.parametrize(("kind", "title"), [("crash", STEERED), ("attitude", IDLED)])
def test_what_was_steered_into_the_ground_has_no_part_to_check(kind: FindingKind, title: str) -> None:
    steered = Finding(kind, title, 40.0, 40.0, "critical", "", "", probability=0.1, suspect="operation")
    assert next_step(failed(steered), has_failed=True).startswith("look at how it was steered")


@pytest.mark.parametrize("title", [KILLED, STOPPED])
def test_what_somebody_cut_has_no_motor_to_check(title: str) -> None:
    cut = Finding("crash", title, 40.0, 40.0, "critical", "", "", probability=0.9, suspect="operation")
    assert next_step(failed(cut), has_failed=True).startswith("ask why the motors were cut, and check what the fall")


def test_what_holds_a_vehicle_is_not_on_the_bench() -> None:
    held = Finding("blocked", "something holds it", 40.0, 60.0, "critical", "", "", probability=0.9, suspect="world")
    crashed = Finding("crash", "it crashed", 60.0, 60.0, "critical", "", "", probability=0.1)
    named = replace(failed(held, crashed), hypotheses=(Hypothesis("world", held.title, 0.9),))
    assert next_step(named, has_failed=True).startswith("free it, and look at what it is caught on; then try it")


def test_a_symptom_is_no_part_to_check() -> None:
    lost = Finding("attitude", "control was lost", 50.0, 60.0, "critical", "", "", probability=0.3)
    named = replace(failed(lost), hypotheses=(Hypothesis("hardware", lost.title, 0.7), Hypothesis("chance", "", 0.3)))
    assert next_step(named, has_failed=True) == bench(named.run)


def test_what_swung_until_control_was_lost_has_no_motor_to_check() -> None:
    lost = Finding("attitude", "control was lost", 55.0, 60.0, "critical", "", "")
    swings = Finding("tuning", "roll oscillates", 50.0, 60.0, "critical", "", "", "parameter", 0.6)
    said = next_step(failed(replace(swings, followed_by=(lost,))), has_failed=True)
    assert said.startswith("look at the gains and filters of what swings (roll oscillates); then try it in the")


@pytest.mark.parametrize(("severity", "is_pack"), [("warning", False), ("critical", True)])
def test_a_battery_that_held_comes_after_what_ended_the_run(severity: Severity, *, is_pack: bool) -> None:
    link = Finding("radio", "the radio link was lost", 50.0, 60.0, "critical", "", "", probability=0.9)
    empty = Finding("battery", "the battery was only partly charged", 0.0, 60.0, severity, "", "", probability=0.9)
    told = (empty, link) if is_pack else (link, empty)
    rivals = Hypothesis("hardware", link.title, 0.55), Hypothesis("hardware", empty.title, 0.4)
    ended = replace(failed(*told), hypotheses=rivals)
    assert (next_step(ended, has_failed=True) == "charge or replace the battery") is is_pack
    if not is_pack:
        assert "check the link's antennas and range" in next_step(ended, has_failed=True)
    ahead = replace(
        ended, hypotheses=(Hypothesis("hardware", link.title, 0.8), Hypothesis("hardware", empty.title, 0.1))
    )
    assert next_step(ahead, has_failed=True).startswith("check the link's antennas and range"), "what leads by far"
    assert ("charge or replace the battery" in next_step(ahead, has_failed=True)) is is_pack


def test_where_nothing_failed_no_part_is_named() -> None:
    empty = Finding("battery", "the battery was only partly charged", 0.0, 60.0, "warning", "", "", probability=0.9)
    assert next_step(failed(empty), has_failed=False) == ""


def test_what_can_be_put_right_at_once_comes_first() -> None:
    empty = Finding("battery", "the battery was only partly charged", 0.0, 60.0, "critical", "", "", probability=0.9)
    assert next_step(failed(empty), has_failed=True) == "charge or replace the battery"
    refused = Finding("prearm", "arming was refused: Check ANGLE_MAX", 0.0, 9.0, "critical", "", "", "parameter", 0.3)
    assert next_step(failed(refused), has_failed=True) == "clear what refused arming: Check ANGLE_MAX"
    title = "SERVO2_FUNCTION was changed in flight, which switched motor 2 off"
    changed = failed(Finding("motor", title, 17.0, 18.0, "critical", "", "", "parameter", 0.95))
    told = replace(changed, hypotheses=(Hypothesis("parameter", "SERVO2_FUNCTION", 0.9), Hypothesis("chance", "", 0.1)))
    said = next_step(told, has_failed=True)
    assert said == "put SERVO2_FUNCTION back as the findings say, then try it in the simulator or a low hover"


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("FRAME_TYPE", "set FRAME_TYPE to 0 ('param set FRAME_TYPE 0'), then try it"),
        ("TKOFF_RPM_MIN", "check whether TKOFF_RPM_MIN is right for this vehicle, then try it"),  # it protects
    ],
)
def test_the_value_that_a_finding_wants_is_told_with_its_command_but_of_a_protection(name: str, says: str) -> None:
    kept = Finding(
        "takeoff", "the motors were kept from spooling up", 30.5, 35.0, "critical", "", "", "parameter", 0.9,
        parameters=(name,), wanted=((name, 0.0),),
    )  # fmt: skip
    told = replace(failed(kept), hypotheses=(Hypothesis("parameter", name, 0.96),))
    assert next_step(told, has_failed=True).startswith(says)


@pytest.mark.parametrize(
    ("kind", "says"),
    [
        ("prearm", "set FRAME_TYPE to how this vehicle is built: it is 15, and the default is 0"),
        ("takeoff", "set FRAME_TYPE to 0"),
    ],
)
def test_a_refusal_knows_no_more_of_how_a_vehicle_is_built_than_the_default(kind: FindingKind, says: str) -> None:
    check = Finding(
        kind, "arming was refused: Check frame type", 1.7, 9.0, "critical", "", "", "parameter", 0.9,
        parameters=("FRAME_TYPE",), wanted=(("FRAME_TYPE", 0.0),),
    )  # fmt: skip
    told = replace(failed(check), hypotheses=(Hypothesis("parameter", "FRAME_TYPE", 0.96),))
    settings = {"FRAME_TYPE": Setting("FRAME_TYPE", 15.0, "PARM", 0.0)}
    assert next_step(replace(told, run=replace(told.run, settings=settings)), has_failed=True).startswith(says)


def test_of_two_motors_that_were_switched_off_both_are_switched_on() -> None:
    off = [
        Finding(
            "tuning", f"{name} was changed in flight", 19.0, 20.0, "critical", "", "", "parameter", parameters=(name,)
        )
        for name in ("SERVO2_FUNCTION", "SERVO4_FUNCTION")
    ]
    told = replace(failed(*off), hypotheses=(Hypothesis("parameter", "SERVO2_FUNCTION", 0.9),))
    said = next_step(told, has_failed=True)
    assert said.startswith("put SERVO2_FUNCTION and SERVO4_FUNCTION back as the findings say")


def test_a_change_that_was_chosen_by_hand_does_not_come_before_what_failed() -> None:
    chosen = replace(failed(THRUST, fixed=True), abstained="too little thrust: nothing is changed until that is mended")
    assert next_step(chosen, has_failed=True).startswith("check the propellers, motors and the battery under load")
    assert "no change is advised: too little thrust" in str(verdict_of(chosen).advice)


def test_a_parameter_that_is_to_stay_is_not_put_back() -> None:
    slow = Finding("attitude", "it came down slowly", 1.0, 2.0, "warning", "", "", "parameter", wanted=(("A", 40.0),))
    named = Hypothesis("parameter", "A", 0.97)
    kept = replace(failed(slow), hypotheses=(named,), abstained="nothing is likely enough, with A, B kept as it is")
    assert next_step(kept, has_failed=True) == "let A change as well: without it nothing is likely enough"
    free = replace(kept, abstained="nothing is likely enough")
    assert next_step(free, has_failed=True) == "set A to 40 ('param set A 40')"


def test_a_change_says_how_likely_it_is_the_cause() -> None:
    made = failed(LATE, fixed=True)
    named, other = Hypothesis("parameter", "land_speed", 0.7), Hypothesis("parameter", "max_speed", 0.2)
    told = replace(made, hypotheses=(named, other))
    assert "land_speed 16 -> 50 (70% the cause)" in str(verdict_of(told).advice)
    assert "(70% the cause, weak training support)" in str(replace(verdict_of(told).advice, confidence="low"))
    document = remembered(published(build_document(told)))
    assert str(remembered_verdict(document).advice) == str(verdict_of(told).advice)
    assert "confidence in the cause" in str(verdict_of(replace(made, hypotheses=(other,))).advice)


@pytest.mark.parametrize(("odds", "helps"), [(0.9, True), (0.2, False), (0.01, False)])
def test_what_an_operator_chose_is_told_with_its_odds_and_never_suggested(odds: float, helps: bool) -> None:
    made = replace(failed(LATE, fixed=True), odds_as_driven=0.2, why_this="of the suggestion")
    assert made.fix is not None
    chosen = replace(made, fix=replace(made.fix, p_fixed=odds, by_hand=True), why_this="")
    told = verdict_of(chosen)
    assert str(told.advice).startswith("Chosen by hand: land_speed 16 -> 50: ")
    assert "confidence" not in str(told.advice)
    assert ("it is not predicted to help" in str(told.advice)) is not helps
    assert ("make the change" in told.next_step) is helps
    document = remembered(published(build_document(chosen)))
    assert str(remembered_verdict(document).advice) == str(told.advice)
    assert "+++ chosen by hand" in to_text(chosen)

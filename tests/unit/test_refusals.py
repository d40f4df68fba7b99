"""What the checks before arming read: the table, refusals by their text, and the parameters that a finding names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pytest

from care_core.ecosystems.ardupilot.examining import find
from care_core.ecosystems.ardupilot.texts import in_full, refusal_of
from care_core.ecosystems.findings import Finding, every_finding
from care_core.ecosystems.way_back import way_back
from care_core.logs.base import Table
from care_core.metadata import ardupilot
from care_core.metadata.causal_map import meaning_of
from care_core.metadata.fact import expanded
from care_core.metadata.refusals import RELATIONS, TABLE, Must, refusal_reads
from care_core.run import Setting
from tests.flights import END_S, Made, flight_of

ROWS = [line.split("\t") for line in TABLE.read_text(encoding="utf-8").splitlines() if not line.startswith("#")][1:]
NAMES = frozenset(ardupilot.names())
COPTER = frozenset(
    name for name in NAMES if any((one.vehicle, one.version) == ("C", "4.5") for one in ardupilot.known_in(name))
)


def _names(pattern: str) -> list[str]:
    filled = pattern.replace("{n}", "2").replace("{k}", "2").replace("{m}", "34")
    return list(expanded(filled))


def test_every_row_reads_parameters_that_are_known_and_bounds_them_in_known_words() -> None:
    for text, reads, must, also in ROWS:
        assert reads, text
        assert also in ("", "world", "voltage", "calibration"), text
        for pattern in reads.split():
            assert NAMES.intersection(_names(pattern)), pattern
        for bound in filter(None, must.split("; ")):
            for part in bound.split(" if "):
                left, relation, right = part.split()
                assert relation in RELATIONS, bound
                assert NAMES.intersection(_names(left)), bound
                assert (
                    right.lstrip("-").replace(".", "").isdigit() or right == "{m}" or NAMES.intersection(_names(right))
                )
    assert sorted(ROWS) == ROWS


def test_the_causal_map_knows_that_arming_reads_what_a_refusal_reads() -> None:
    read = {name for _, reads, *_ in ROWS for pattern in reads.split() for name in _names(pattern)}
    for kind in ("copter", "rover", "plane"):
        own = (one for one in read if any(at.vehicle == ardupilot.VEHICLES[kind] for at in ardupilot.known_in(one)))
        for meaning in (meaning_of(name, kind) for name in own):
            assert meaning is not None
            assert "arming" in meaning.read, meaning.name
            assert "refused" in meaning.signs, meaning.name
            assert meaning.role != "idle", meaning.name


@pytest.mark.parametrize(
    ("text", "first"),
    [
        ("Check ANGLE_MAX", ("ANGLE_MAX",)),
        ("RTL_ALT_TYPE is above-terrain but no terrain data", ("RTL_ALT_TYPE", "TERRAIN_ENABLE")),
        ("GPS 2: Bad fix", ("GPS_TYPE2",)),
        ("GPS 1 still configuring this GPS", ("GPS_TYPE", "GPS_AUTO_CONFIG")),
        ("Battery 2 below minimum arming capacity", ("BATT2_ARM_MAH", "BATT2_CAPACITY")),
        ("SERVO4_MAX is less than SERVO4_TRIM", ("SERVO4_MAX", "SERVO4_TRIM")),
        ("AHRS: EK3_MAG_CAL and EK3_SRC1_YAW inconsiste", ("EK3_MAG_CAL", "EK3_SRC1_YAW")),
        ("Motors: no SERVOx_FUNCTION set to Motor10", ("SERVO10_FUNCTION", "FRAME_CLASS", "FRAME_TYPE")),
        ("Bad parameter: PSC_POSXY_P must be > 0", ("PSC_POSXY_P",)),
        ("Main loop slow (234Hz < 400Hz)", ("SCHED_LOOP_RATE",)),
        ("Throttle below failsafe", ("FS_THR_VALUE", "RC3_MIN")),
        ("nobody ever said that", ()),
    ],
)
def test_a_refusal_tells_what_its_check_reads(text: str, first: tuple[str, ...]) -> None:
    assert refusal_reads(text, "copter", COPTER).parameters[: len(first)] == first
    if not first:
        assert refusal_reads(text, "copter", COPTER).parameters == ()


def test_a_vehicle_of_another_release_is_read_by_its_own_names() -> None:
    assert refusal_reads("GPS 2: Bad fix", "copter", {"GPS2_TYPE"}).parameters == ("GPS2_TYPE",)
    assert refusal_reads("Check ANGLE_MAX", "copter", {"ATC_ANGLE_MAX"}).named == ("ATC_ANGLE_MAX",)


def test_what_must_hold_is_broken_only_where_all_of_it_is_known() -> None:
    bound = Must("INS_ACC3OFFS_X", "=", "0", Must("INS_ACC3_ID", "=", "0"))
    assert bound.is_broken({"INS_ACC3OFFS_X": 3.5, "INS_ACC3_ID": 0.0})
    assert not bound.is_broken({"INS_ACC3OFFS_X": 3.5, "INS_ACC3_ID": 2753044.0})
    assert not bound.is_broken({"INS_ACC3OFFS_X": 3.5})
    assert not Must("BATT_CRT_VOLT", "<", "BATT_LOW_VOLT").is_broken({"BATT_CRT_VOLT": 11.0})
    assert Must("AHRS_TRIM_X", "within", "0.175").is_broken({"AHRS_TRIM_X": -0.3})


def test_a_bound_that_no_check_asks_is_told_as_what_is_usual() -> None:
    bound = Must("COMPASS_OFS2_Z", "usually", "350")
    assert bound.is_broken({"COMPASS_OFS2_Z": -575.0})
    assert bound.asks("COMPASS_OFS2_Z", {"COMPASS_OFS2_Z": -575.0}) == "is usually within 350"


Off = tuple[float, float | None]
"""A value and its default; None where the log does not tell it."""


def refused(*texts: str, **settings: Off) -> Finding:
    """The finding of a vehicle that never armed, with these refusals and parameters."""
    return refused_at(12.6, texts, settings)


def refused_at(
    volts: float, texts: Sequence[str], settings: Mapping[str, Off], *, has_receiver: bool = True
) -> Finding:
    made = Made()
    made.table["GPS"]["Status"] *= has_receiver
    del made.rows["ARM"]
    made.table["CTUN"]["ThO"][:] = 0.0
    made.table["BAT"]["Volt"][:] = volts + made.noise(0.01)
    made.rows["MSG"] = [(t, {"Message": f"Arm: {text}"}) for t in (20.0, 30.0, 40.0) for text in texts]
    known = {name: (Setting(name, value, "PARM", default),) for name, (value, default) in settings.items()}
    flight = flight_of(made.tables(), {**made.known, **known}, made.facts, END_S)
    (finding,) = [one for one in every_finding(find(flight)) if one.kind == "prearm"]
    return finding


def test_a_parameter_that_the_text_names_is_named_with_its_default_and_the_way_back() -> None:
    finding = refused("RTL_ALT_TYPE is above-terrain but no terrain data", RTL_ALT_TYPE=(1, 0), TERRAIN_ENABLE=(0, 0))
    assert (finding.suspect, finding.parameters, finding.wanted) == (
        "parameter",
        ("RTL_ALT_TYPE",),
        (("RTL_ALT_TYPE", 0),),
    )
    assert "RTL_ALT_TYPE is 1 (default 0): 'param set RTL_ALT_TYPE 0' puts it back" in finding.evidence
    assert finding.probability >= 0.9


def test_a_command_of_the_way_back_rounds_no_bitmask() -> None:
    assert way_back("SERVO_DSHOT_ESC", "wiring", 1048575.0) == "'param set SERVO_DSHOT_ESC 1048575' puts it back"


@pytest.mark.parametrize(
    ("text", "settings", "named"),
    [
        ("SERVO2_MAX is less than SERVO2_TRIM", {"SERVO2_MAX": (1452, 1900), "SERVO2_TRIM": (1500, 1500)},
         "SERVO2_MAX"),
        ("SERVO2_MAX is less than SERVO2_TRIM", {"SERVO2_MAX": (1450, 1900), "SERVO2_TRIM": (1540, 1500)},
         "SERVO2_MAX"),  # the other at its default would not be enough
        ("SERVO4_MAX is less than SERVO4_TRIM", {"SERVO4_MAX": (1900, 1900), "SERVO4_TRIM": (2200, 1500)},
         "SERVO4_TRIM"),
        ("Check ACRO_BAL_ROLL/PITCH", {"ACRO_BAL_ROLL": (1, 1), "ATC_ANG_RLL_P": (0.8, 4.5), "ACRO_BAL_PITCH": (1, 1),
                                       "ATC_ANG_PIT_P": (4.1, 4.5)}, "ATC_ANG_RLL_P"),
        ("AHRS: EK3 sources require VisualOdom", {"EK3_SRC2_VELZ": (6, 0), "EK3_SRC1_POSZ": (2, 1)}, "EK3_SRC2_VELZ"),
        ("Motors: no SERVOx_FUNCTION set to Motor1", {"SERVO1_FUNCTION": (52, 33), "SERVO9_FUNCTION": (7, 0),
                                                      "FRAME_CLASS": (1, 0)}, "SERVO1_FUNCTION"),
        ("Motors: Check frame class and type", {"FRAME_CLASS": (2, 1), "FRAME_TYPE": (10, 1)}, "FRAME_TYPE"),
        ("GPS 1: primary but TYPE 0", {"GPS_PRIMARY": (1, 0), "GPS_TYPE": (0, 0)}, "GPS_PRIMARY"),
    ],
)  # fmt: skip
def test_of_what_a_check_reads_the_one_that_breaks_it_is_named(text: str, settings: dict[str, Off], named: str) -> None:
    finding = refused(text, **settings)
    assert finding.parameters == (named,)
    assert finding.wanted[0][0] == named


def test_a_protection_is_never_loosened_and_a_calibration_is_done_again() -> None:
    safety = refused(
        "Battery 1 voltage failsafe critical >= low", BATT_CRT_VOLT=(11.8, 9.6), BATT_LOW_VOLT=(10.5, 10.5)
    )
    assert (safety.parameters, safety.wanted) == (("BATT_CRT_VOLT",), ())
    assert "BATT_CRT_VOLT is 11.8 (default 9.6), must be below BATT_LOW_VOLT (10.5): check it first" in safety.evidence
    assert "param set" not in safety.evidence
    calibration = refused(
        "3D Accel calibration needed",
        INS_ACC3OFFS_X=(3.5, 0),
        INS_ACC3_ID=(0, 0),
        INS_ACCOFFS_X=(0.4, 0),
        INS_ACC_ID=(2, 0),
    )
    assert (calibration.parameters, calibration.wanted) == (("INS_ACC3OFFS_X",), ())
    assert "calibrate again" in calibration.evidence


def test_what_is_calibrated_as_it_should_be_is_not_named() -> None:
    finding = refused("3D Accel calibration needed", INS_ACCOFFS_X=(0.4, 0), INS_ACC_ID=(2, 0), INS_ACCSCAL_X=(1.01, 1))
    assert (finding.suspect, finding.parameters) == ("operation", ())
    assert not refused("Accels inconsistent", INS_ACC2OFFS_Y=(0.3, 0)).parameters
    assert refused("Accels inconsistent", INS_ACC2OFFS_Y=(-3.5, 0)).parameters == ("INS_ACC2OFFS_Y",)


@pytest.mark.parametrize(
    ("text", "settings", "named"),
    [
        ("servo function 33 unassigned", {"FRAME_TYPE": (2, 0), "SERVO1_FUNCTION": (26, 26)}, "FRAME_TYPE"),
        ("check steering and throttle config", {"SERVO1_FUNCTION": (109, 26)}, "SERVO1_FUNCTION"),
        ("check skid steering config", {"SERVO3_FUNCTION": (74, 70)}, "SERVO3_FUNCTION"),
        ("Board (5.0v) out of range 5.5-5.8v", {"BRD_VBUS_MIN": (5.5, 4.3)}, "BRD_VBUS_MIN"),
        ("AHRS: ExternalAHRS: Invalid backend", {"AHRS_EKF_TYPE": (11, 3)}, "AHRS_EKF_TYPE"),
    ],
)
def test_refusals_of_rovers_and_boards_name_what_they_read(text: str, settings: dict[str, Off], named: str) -> None:
    assert named in refused(text, **settings).parameters


def test_of_a_rovers_outputs_those_are_named_that_have_what_it_lacks_as_shipped() -> None:
    outputs = {"SERVO1_FUNCTION": (51, 26), "SERVO3_FUNCTION": (0, 70), "SERVO6_FUNCTION": (70, 0)}
    assert refused("check steering and throttle config", **outputs).parameters == ("SERVO1_FUNCTION",)


def test_what_wants_a_position_is_no_reason_beside_a_receiver_without_a_fix() -> None:
    off = {"FENCE_ENABLE": (1, 0)}
    assert refused("Fence requires position", **off).parameters == ("FENCE_ENABLE",)
    assert not refused("GPS 1: Bad fix", "Fence requires position", **off).parameters


def test_a_refusal_where_nothing_that_it_reads_is_off_stays_as_it_is() -> None:
    for text in ("Need Position Estimate", "GPS 1: Bad fix", "Check mag field (xy diff:130>100)"):
        finding = refused(text, EK3_SRC1_POSXY=(3, 3), GPS_TYPE=(1, 1), COMPASS_OFS_X=(43, 0), GPS_RATE_MS=(200, 200))
        assert (finding.suspect, finding.parameters) == ("parameter", ())
        assert finding.probability == 0.3


def test_what_the_pilot_has_to_do_names_no_parameter() -> None:
    for text in ("RC not found", "Throttle too high", "Hardware safety switch", "RTL mode not armable", "Leaning"):
        finding = refused(text, FS_THR_VALUE=(1100, 975), ANGLE_MAX=(4500, 3000), BRD_SAFETYENABLE=(1, 0))
        assert (finding.suspect, finding.parameters) == ("operation", ())


def test_where_surroundings_may_be_the_reason_a_parameter_is_less_sure() -> None:
    alone, outside = (
        refused("GPS 2 still configuring this GPS", GPS_TYPE2=(9, 0)),
        refused("GPS 2: Bad fix", GPS_TYPE2=(19, 0)),
    )
    assert alone.parameters == outside.parameters == ("GPS_TYPE2",)
    assert outside.probability < alone.probability < 0.9


@pytest.mark.parametrize(("has_receiver", "named"), [(True, ("EK3_VELNE_M_NSE",)), (False, ("GPS_TYPE",))])
def test_a_receiver_that_never_answers_is_the_reason_and_its_operator_knows_why(
    has_receiver: bool, named: tuple[str, ...]
) -> None:
    off = {"GPS_TYPE": (6.0, 1.0), "EK3_VELNE_M_NSE": (0.14, 0.5)}
    finding = refused_at(12.6, ("AHRS: waiting for home",), off, has_receiver=has_receiver)
    assert finding.parameters == named
    assert "GPS_TYPE" not in dict(finding.wanted)


def test_how_a_real_vehicle_is_mounted_is_looked_at_before_it_is_put_back() -> None:
    turned = {"COMPASS_ORIENT": (6.0, 0.0)}
    real = refused_at(12.6, ("Compasses inconsistent",), turned)
    assert (real.parameters, real.wanted) == (("COMPASS_ORIENT",), ())
    assert "COMPASS_ORIENT is 6 (default 0): check it first" in real.evidence
    simulated = refused_at(12.6, ("Compasses inconsistent",), {**turned, "SIM_SPEEDUP": (1.0, 1.0)})
    assert simulated.wanted == (("COMPASS_ORIENT", 0.0),)


def test_what_is_only_a_little_off_is_not_blamed() -> None:
    finding = refused("AHRS: waiting for home", EK3_POSNE_M_NSE=(0.6, 0.5), EK3_VELNE_M_NSE=(5.0, 0.3))
    assert finding.parameters == ("EK3_VELNE_M_NSE",)


def test_a_default_that_the_log_lacks_is_the_firmwares() -> None:
    finding = refused("SERVO2_MAX is less than SERVO2_TRIM", SERVO2_MAX=(1452, None), SERVO2_TRIM=(1500, None))
    assert finding.parameters == ("SERVO2_MAX",)


def test_several_refusals_name_what_each_of_them_reads() -> None:
    finding = refused(
        "AHRS: EK3 sources require RangeFinder", "Check ACRO_BAL_ROLL/PITCH", "Throttle too high",
        EK3_SRC1_POSZ=(2, 1), ACRO_BAL_ROLL=(1, 1), ATC_ANG_RLL_P=(0.8, 4.5), GPS_TYPE2=(5, 0),
    )  # fmt: skip
    assert sorted(finding.parameters) == ["ATC_ANG_RLL_P", "EK3_SRC1_POSZ"]


def test_a_battery_that_is_low_is_the_reason_itself() -> None:
    text = "Battery 1 low voltage failsafe"
    low = refused_at(10.2, (text,), {"BATT_LOW_VOLT": (10.4, 10.5), "BATT_VOLT_MULT": (10.1, 10.1)})
    assert low.parameters == ()
    scaled = refused_at(10.25, (text,), {"BATT_LOW_VOLT": (10.5, 10.5), "BATT_VOLT_MULT": (8.218, 10.1)})
    assert scaled.parameters == ("BATT_VOLT_MULT",)
    assert scaled.wanted == ()
    calibrated = refused_at(10.25, (text,), {"BATT_LOW_VOLT": (10.5, 10.5), "BATT_VOLT_MULT": (12.02, 10.1)})
    assert calibrated.parameters == ()
    level = refused_at(12.5, (text,), {"BATT_LOW_VOLT": (13.2, 10.5), "BATT_VOLT_MULT": (10.1, 10.1)})
    assert level.parameters == ("BATT_LOW_VOLT",)
    assert "check it first" in level.evidence


def test_a_monitor_is_never_switched_off_for_want_of_a_battery() -> None:
    text = "Battery 1 low voltage failsafe"
    assert refused_at(0.8, (text,), {"BATT_MONITOR": (4, 0), "BATT_LOW_VOLT": (10.5, 0)}).parameters == ()
    assert refused_at(0.8, (text,), {"BATT_MONITOR": (11, 4), "BATT_LOW_VOLT": (10.5, 10.5)}).parameters


def test_a_compass_beside_a_parameter_that_cannot_hold_is_not_called_wrong() -> None:
    made = Made()
    del made.rows["ARM"]
    made.table["CTUN"]["ThO"][:] = 0.0
    made.rows["MSG"] = [(t, {"Message": "PreArm: Compasses inconsistent"}) for t in (20.0, 50.0)]
    titles = [one.title for one in find(flight_of(made.tables(), made.known, made.facts, END_S))]
    assert "the firmware finds the compass wrong" in titles
    known = {**made.known, "COMPASS_OFS_Z": (Setting("COMPASS_OFS_Z", -600.0, "PARM", -18.0),)}
    found = find(flight_of(made.tables(), known, made.facts, END_S))
    assert [(one.kind, one.parameters) for one in found if one.suspect == "hardware"] == []
    assert any("COMPASS_OFS_Z" in one.parameters for one in found)


def test_what_later_attempts_no_longer_say_had_passed() -> None:
    made = Made()
    del made.rows["ARM"]
    made.table["CTUN"]["ThO"][:] = 0.0
    starting, lasting = "AHRS: not using configured AHRS type", "SERVO2_MAX is less than SERVO2_TRIM"
    said = [*((t, starting) for t in (12.0, 14.0)), *((t, lasting) for t in (12.0, 14.0, 16.2, 18.3, 20.5))]
    made.rows["MSG"] = [(t, {"Message": f"Arm: {text}"}) for t, text in sorted(said)]
    off = {"EK3_VELNE_M_NSE": (0.3, 0.5), "SERVO2_MAX": (1452, 1900), "SERVO2_TRIM": (1500, 1500)}
    known = {name: (Setting(name, value, "PARM", default),) for name, (value, default) in off.items()}

    def named(tables: Mapping[str, Table]) -> tuple[str, ...]:
        flight = flight_of(tables, {**made.known, **known}, made.facts, END_S)
        return next(one.parameters for one in every_finding(find(flight)) if one.kind == "prearm")

    assert named(made.tables()) == ("SERVO2_MAX",)
    made.rows["MSG"] = made.rows["MSG"][:4]  # nobody tried often enough to tell
    assert "SERVO2_MAX" in named(made.tables())
    made.rows["MSG"] = [row for row in made.rows["MSG"] if starting in str(row[1]["Message"])]
    assert named(made.tables()) == ("EK3_VELNE_M_NSE",)


@pytest.mark.parametrize("text", ["Need 3D Fix", "Need Position Estimate", "Throttle too high", "High GPS HDOP"])
def test_what_real_vehicles_were_refused_for_in_passing_names_nothing_that_is_calibrated(text: str) -> None:
    """A real copter's parameters that are off their defaults for good: compass, accelerometers, radio, battery."""
    calibrated: dict[str, Off] = {
        "COMPASS_OFS_X": (-37.2, 0), "COMPASS_OFS_Y": (81.5, 0), "INS_ACCOFFS_X": (0.11, 0), "INS_ACCSCAL_Z": (0.99, 1),
        "RC3_MIN": (982, 1100), "RC3_TRIM": (982, 1500), "BATT_CAPACITY": (5200, 3300), "MOT_THST_HOVER": (0.27, 0.35),
        "AHRS_TRIM_X": (0.008, 0), "RTL_ALT": (3000, 1500), "WPNAV_SPEED": (800, 500), "EK3_MAG_CAL": (3, 3),
    }  # fmt: skip
    finding = refused(text, **calibrated)
    assert finding.parameters == ()
    assert finding.suspect in ("operation", "world", "parameter")


def test_a_check_that_takes_one_value_asks_for_it() -> None:
    assert Must("SERVO1_FUNCTION", "=", "33").value_of("SERVO1_FUNCTION") == 33.0
    assert Must("SERVO1_FUNCTION", "!=", "0").value_of("SERVO1_FUNCTION") is None
    assert Must("MOT_PWM_MAX", "=", "MOT_PWM_MIN").value_of("MOT_PWM_MAX") is None


def test_a_receiver_that_has_a_fix_is_of_the_right_type() -> None:
    assert refused("GPS 1: Bad fix", GPS_TYPE=(9, 1)).parameters == ()
    assert refused("GPS 2: Bad fix", GPS_TYPE2=(9, 1)).parameters == ("GPS_TYPE2",)


def test_a_check_that_the_default_cannot_pass_names_it_without_a_value() -> None:
    finding = refused("DO_LAND_START set and RTL_AUTOLAND disabled", RTL_AUTOLAND=(0, 0))
    assert (finding.parameters, finding.wanted) == (("RTL_AUTOLAND",), ())
    assert "RTL_AUTOLAND is 0 (default 0), must be above 0: check it first" in finding.evidence


def test_a_refusal_that_is_cut_is_the_one_that_is_told_in_full() -> None:
    """A status text holds 50 characters, of which "PreArm: " takes three more than "Arm: "."""
    texts = ["Arm: DO_LAND_START set and RTL_AUTOLAND disabled", "PreArm: DO_LAND_START set and RTL_AUTOLAND disable"]
    said = [one for t, text in enumerate(texts) if (one := refusal_of(float(t), text)) is not None]
    assert {one.why for one in in_full(said)} == {"DO_LAND_START set and RTL_AUTOLAND disabled"}
    short = [one for t, text in enumerate(["PreArm: GPS", "PreArm: GPS 1: Bad fix"]) if (one := refusal_of(t, text))]
    assert {one.why for one in in_full(short)} == {"GPS", "GPS 1: Bad fix"}


def test_every_motor_that_no_output_drives_is_set_with_the_one_that_is_named() -> None:
    text, none = "Motors: no SERVOx_FUNCTION set to Motor2", {f"SERVO{n}_FUNCTION": (1.0, 0.0) for n in (2, 3)}
    finding = refused(text, **none, FRAME_CLASS=(1, 1))
    assert finding.parameters == ("SERVO2_FUNCTION",), "one stands for the reason"
    assert finding.wanted == (("SERVO2_FUNCTION", 34), ("SERVO3_FUNCTION", 35)), "the check stops at the first"
    elsewhere = refused(text, **none, SERVO9_FUNCTION=(35, 0), FRAME_CLASS=(1, 1))
    assert elsewhere.wanted == (("SERVO2_FUNCTION", 34),), "what another output drives is not missing"


@pytest.mark.parametrize(("source", "wanted"), [(3.0, (("GPS_TYPE", 1),)), (6.0, ())])
def test_a_receiver_that_is_switched_off_is_put_back_on_where_it_is_to_tell_the_place(
    source: float, wanted: tuple[tuple[str, float], ...]
) -> None:
    settings: dict[str, Off] = {"GPS_TYPE": (0, 1), "EK3_SRC1_POSXY": (source, source)}
    finding = refused_at(12.6, ["AHRS: waiting for home"], settings, has_receiver=False)
    assert (finding.parameters, finding.wanted) == (("GPS_TYPE",), wanted)
    kind = refused_at(12.6, ["AHRS: waiting for home"], {"GPS_TYPE": (8, 1)}, has_receiver=False)
    assert kind.wanted == (), "it, or its cable"


def test_a_stick_behind_the_first_four_channels_is_put_back_where_its_own_is_free() -> None:
    text, others = "Yaw (RC11) is not neutral", {"RCMAP_ROLL": (1, 1), "RCMAP_PITCH": (2, 2), "RCMAP_THROTTLE": (3, 3)}
    assert refused(text, RCMAP_YAW=(11, 4), **others).wanted == (("RCMAP_YAW", 4),)
    assert refused(text, RCMAP_YAW=(11, 4), **{**others, "RCMAP_ROLL": (4, 1)}).wanted == (), "of a layout of its own"
    swapped = refused("Yaw (RC1) is not neutral", RCMAP_YAW=(1, 4), **{**others, "RCMAP_ROLL": (4, 1)})
    assert swapped.wanted == ()

"""Parameters that a run itself shows to be wrong, and the value that it shows instead."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from care_core.ecosystems.ardupilot.checks import fence
from care_core.ecosystems.ardupilot.checks.settings import heading
from care_core.ecosystems.ardupilot.checks.settings.rotations import matrix
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.measures import Mission, find_extractor
from care_core.run import Setting, Unavailable, Value, is_known
from tests.flights import ARMED_S, DOWN_S, END_S, HOVER, UP_S, Made, flight_of

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


@pytest.mark.parametrize("full", [None, 28.05])
@pytest.mark.parametrize("scale", [8.2, 9.0, 13.0])
def test_a_voltage_that_only_the_default_scale_makes_full(scale: float, full: float | None) -> None:
    """Whatever a full pack that was changed as well says of its cells."""
    made = MadeWithDefaults()
    made.drive("BATT_VOLT_MULT", scale, 10.1)
    if full is not None:
        made.drive("MOT_BAT_VOLT_MAX", full, 12.8)
    made.table["BAT"]["Volt"] *= scale / 10.1
    finding = made.find()[0]
    assert finding.parameters == ("BATT_VOLT_MULT",)
    assert finding.wanted == (("BATT_VOLT_MULT", 10.1),)
    assert "the battery was only partly charged" not in [one.title for one in made.find()]


def test_a_scale_of_ones_own_that_reads_rightly_is_none() -> None:
    made = MadeWithDefaults()
    made.drive("BATT_VOLT_MULT", 18.0, 10.1)
    assert made.find() == ()


def test_a_drained_pack_stays_one_with_a_scale_of_ones_own() -> None:
    made = MadeWithDefaults()
    made.drive("BATT_VOLT_MULT", 12.0, 10.1)
    made.table["BAT"]["Volt"] -= 1.5
    assert made.find()[0].title == "the battery was only partly charged"


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
    made.table["BAT"]["EnrgTot"] = np.cumsum(made.table["BAT"]["Volt"] * made.table["BAT"]["Curr"]) / 36000.0
    assert naming(made, "BATT_AMP_OFFSET").wanted == (("BATT_AMP_OFFSET", 0.0),)


def drained(made: Made, volts: float, amperes: float) -> None:
    """A full pack of three cells of which a flight leaves so many volts at rest, at so many amperes in flight."""
    flying = made.after(UP_S, DOWN_S)
    made.settings |= {"BATT_AMP_PERVLT": 17.0, "BATT_CAPACITY": 3300.0}
    made.table["BAT"]["Volt"] = np.interp(made.t, [UP_S, DOWN_S], [12.6, volts]) - np.where(flying, 0.6, 0.0)
    made.table["BAT"]["Curr"] = np.where(flying, amperes, 0.5) + made.noise(0.05)


@pytest.mark.parametrize("scale", [6.0, 8.0, 40.0])
def test_a_current_that_only_the_default_scale_makes_the_charge_that_was_used(scale: float) -> None:
    made = MadeWithDefaults()
    drained(made, 11.5, 60.0 * scale / 17.0)  # 1.5 of 3.3 Ah, and half of it by the voltage
    made.drive("BATT_AMP_PERVLT", scale, 17.0)
    finding = naming(made, "BATT_AMP_PERVLT")
    assert finding.wanted == (("BATT_AMP_PERVLT", 17.0),)
    assert "the voltage at rest says that 50% were used" in finding.evidence
    energy = energy_of(made)
    assert isinstance(energy, Unavailable)
    assert "BATT_AMP_PERVLT" in energy.reason


def test_a_current_of_ones_own_scale_that_fits_the_voltage_or_a_pack_that_was_not_full_names_none() -> None:
    made = MadeWithDefaults()
    drained(made, 11.5, 60.0)
    made.drive("BATT_AMP_PERVLT", 40.0, 17.0)
    assert made.find() == ()
    drained(made, 11.5, 140.0)
    made.table["BAT"]["Volt"] -= 0.5
    assert all("BATT_AMP_PERVLT" not in one.parameters for one in made.find())


def test_a_current_that_does_not_answer_to_the_motors_is_the_pins() -> None:
    made = MadeWithDefaults()
    made.drive("BATT_CURR_PIN", 14, 12)
    assert all("BATT_CURR_PIN" not in one.parameters for one in made.find()), "it does here"
    made.table["BAT"]["Curr"] = 0.8 + made.noise(0.01)
    assert naming(made, "BATT_CURR_PIN").wanted == (("BATT_CURR_PIN", 12.0),)


@pytest.mark.parametrize("full", [6.0, 10.25, 16.8, 25.2])
def test_a_full_pack_that_the_thrust_is_not_scaled_for(full: float) -> None:
    made = MadeWithDefaults()
    made.drive("MOT_BAT_VOLT_MAX", full, 0.0)
    finding = naming(made, "MOT_BAT_VOLT_MAX")
    assert (finding.severity, finding.wanted) == ("warning", (("MOT_BAT_VOLT_MAX", 12.6),))


@pytest.mark.parametrize("full", [12.0, 12.6, 13.05])
def test_a_full_pack_of_any_chemistry_is_none(full: float) -> None:
    made = MadeWithDefaults()
    made.drive("MOT_BAT_VOLT_MAX", full, 0.0)
    assert made.find() == ()


def test_a_charged_pack_tells_its_cells_where_no_threshold_does() -> None:
    made = MadeWithDefaults()
    made.settings["BATT_LOW_VOLT"] = 0.0
    made.drive("MOT_BAT_VOLT_MAX", 25.2, 0.0)
    assert naming(made, "MOT_BAT_VOLT_MAX").wanted == (("MOT_BAT_VOLT_MAX", 12.6),)


@pytest.mark.parametrize(("empty", "lost"), [(13.2, "not scaled"), (12.0, "hardly scaled")])
def test_an_empty_pack_that_stands_near_the_full_one(empty: float, lost: str) -> None:
    made = MadeWithDefaults()
    made.drive("MOT_BAT_VOLT_MIN", empty, 0.0)
    finding = naming(made, "MOT_BAT_VOLT_MIN")
    assert finding.wanted == (("MOT_BAT_VOLT_MIN", 9.9),)
    assert lost in finding.evidence


@pytest.mark.parametrize("empty", [7.5, 9.9, 10.5, 11.1])
def test_an_empty_pack_of_any_chemistry_is_none(empty: float) -> None:
    made = MadeWithDefaults()
    made.drive("MOT_BAT_VOLT_MIN", empty, 0.0)
    assert made.find() == ()


def climbs(slope: float, noise: float = 0.02) -> MadeWithDefaults:
    """A flight that climbs and descends again and again, whose thrust grows so with its throttle."""
    made = MadeWithDefaults()
    flies = made.after(UP_S + 4, DOWN_S - 4)
    swing = np.where(flies, 0.1 * np.sin(made.t), 0.0)
    made.table["CTUN"]["ThO"] = np.where(flies, HOVER * np.exp(swing), made.table["CTUN"]["ThO"])
    made.table["PSCD"] = {"AD": 9.81 - 9.81 * np.exp(slope * swing) + made.noise(noise * 9.81)}
    return made


def test_a_thrust_that_grows_faster_than_its_throttle_is_the_curves() -> None:
    made = climbs(1.5)
    made.drive("MOT_THST_EXPO", -0.3, 0.65)
    finding = naming(made, "MOT_THST_EXPO")
    assert (finding.severity, finding.wanted) == ("warning", (("MOT_THST_EXPO", 0.65),))
    assert "thrust grows 1.5" in finding.evidence


@pytest.mark.parametrize(
    ("slope", "noise", "expo"), [(1.0, 0.02, 0.3), (0.6, 0.02, -0.3), (1.5, 0.3, -0.3), (1.5, 0.02, 0.65)]
)
def test_a_thrust_that_tells_no_wrong_curve(slope: float, noise: float, expo: float) -> None:
    made = climbs(slope, noise)
    made.drive("MOT_THST_EXPO", expo, 0.65)
    assert not [one for one in made.find() if "MOT_THST_EXPO" in one.parameters]


def energy_of(made: Made) -> Value:
    tables = made.tables()
    model = flight_of(tables, made.known, made.facts, END_S)
    return find_extractor("energy_used").compute(Mission(model, tables, ARMED_S, DOWN_S, True, {}), {})


def test_no_energy_follows_from_a_current_that_is_measured_wrongly() -> None:
    made = MadeWithDefaults()
    assert is_known(energy_of(made))
    made.settings["BATT_AMP_PERVLT"] = 17.0
    made.table["BAT"]["Curr"] += 8.5 - 0.5
    made.table["BAT"]["EnrgTot"] = np.cumsum(made.table["BAT"]["Volt"] * made.table["BAT"]["Curr"]) / 36000.0
    made.drive("BATT_AMP_OFFSET", -0.5, 0.0)
    energy = energy_of(made)
    assert isinstance(energy, Unavailable)
    assert "BATT_AMP_OFFSET" in energy.reason
    assert energy.hint == "put BATT_AMP_OFFSET back to 0"


def test_no_energy_without_a_monitor_is_the_monitors_parameter() -> None:
    made = MadeWithDefaults()
    made.table.pop("BAT")
    without = energy_of(made)
    assert isinstance(without, Unavailable)
    assert "LOG_BITMASK" in without.hint  # nobody set the monitor otherwise: it was not recorded
    made.drive("BATT_MONITOR", 20, 4)
    energy = energy_of(made)
    assert isinstance(energy, Unavailable)
    assert "BATT_MONITOR=20" in energy.reason
    assert energy.hint == "put BATT_MONITOR back to 4"


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


# --- compasses


def compasses(made: Made, **settings: float) -> None:
    made.settings |= {"COMPASS_EXTERNAL": 1, "COMPASS_EXTERN2": 0, **settings}


def turn(made: Made, table: str, rotation: np.ndarray) -> None:
    field = made.table[table]
    turned = rotation @ np.stack([field[f"Mag{axis}"] for axis in "XYZ"])
    for axis, row in zip("XYZ", turned, strict=True):
        field[f"Mag{axis}"][:] = row


def mounting(number: float) -> np.ndarray:
    found = matrix(number)
    assert found is not None
    return found


def manoeuvre(made: Made) -> None:
    """Speeds up and slows down to all sides, as the leans say, at the heading that the compasses tell."""
    flying = made.after(20.0, 90.0)
    roll, pitch = (10.0 * np.sin(made.t / period) * flying for period in (1.7, 2.3))
    turned = np.radians(made.table["ATT"]["Yaw"])
    for angle, value in (("Roll", roll), ("Pitch", pitch)):
        for name in (angle, f"Des{angle}"):
            made.table["ATT"][name][:] = value
    lean = 9.81 * (-np.tan(np.radians(pitch)) + 1j * np.tan(np.radians(roll)) / np.cos(np.radians(pitch)))
    speed = np.cumsum(lean * np.exp(1j * turned)) * float(np.diff(made.t)[0])
    late = np.interp(made.t - 0.2, made.t, speed.real) + 1j * np.interp(made.t - 0.2, made.t, speed.imag)
    made.table["GPS"] |= {"Spd": np.abs(late), "GCrs": np.degrees(np.angle(late)) % 360.0}
    level = np.array([np.zeros(len(made.t)), np.zeros(len(made.t)), np.zeros(len(made.t))])
    level[0], level[1], level[2] = 220 * np.cos(turned), -220 * np.sin(turned), 420.0
    cr, sr, cp, sp = (f(np.radians(a)) for a in (roll, pitch) for f in (np.cos, np.sin))
    x = cp * level[0] - sp * level[2]
    down = sp * level[0] + cp * level[2]
    for table in ("MAG", "MAG#2"):
        made.table[table] |= {"MagX": x, "MagY": cr * level[1] + sr * down, "MagZ": -sr * level[1] + cr * down}


@pytest.mark.parametrize("number", [1, 2, 4, 6, 8, 12, 24])
def test_a_compass_that_is_told_a_wrong_mounting(number: int) -> None:
    made = MadeWithDefaults()
    compasses(made)
    made.drive("COMPASS_ORIENT", number, 0)
    turn(made, "MAG", mounting(number))
    finding = made.find()[0]
    assert finding.wanted == (("COMPASS_ORIENT", 0.0),)
    assert [one.title for one in made.find()] == ["compass 1 is set up wrongly"]


@pytest.mark.parametrize("number", [2, 8])
def test_a_board_that_is_told_a_wrong_mounting(number: int) -> None:
    made = MadeWithDefaults()
    compasses(made)
    made.drive("AHRS_ORIENTATION", number, 0)
    turn(made, "MAG#2", mounting(number))
    assert naming(made, "AHRS_ORIENTATION").wanted == (("AHRS_ORIENTATION", 0.0),)


@pytest.mark.parametrize("orient", [0.0, 6.0])
def test_a_compass_inside_a_turned_board_that_is_said_to_be_outside(orient: float) -> None:
    made = MadeWithDefaults()
    compasses(made)
    made.drive("AHRS_ORIENTATION", 8, 0)  # rightly, as gravity tells
    made.drive("COMPASS_EXTERNAL", 1, 0)
    turn(made, "MAG", np.linalg.inv(mounting(8)))
    assert naming(made, "COMPASS_EXTERNAL").wanted == (("COMPASS_EXTERNAL", 0.0),)
    made.drive("COMPASS_ORIENT", orient, 0)
    assert bool([one for one in made.find() if "COMPASS_EXTERNAL" in one.parameters]) == (orient == 0)


def test_a_board_that_nothing_says_is_mounted_as_told_is_doubted_before_where_a_compass_is() -> None:
    made = MadeWithDefaults()
    compasses(made)
    made.drive("AHRS_ORIENTATION", 2, 0)
    made.drive("COMPASS_EXTERNAL", 1, 0)
    turn(made, "MAG", np.linalg.inv(mounting(2)))
    assert naming(made, "AHRS_ORIENTATION").wanted == (("AHRS_ORIENTATION", 0.0),)


def test_a_mounting_off_its_default_that_is_right_is_none() -> None:
    made = MadeWithDefaults()
    compasses(made)
    made.drive("COMPASS_ORIENT", 6, 0)
    made.drive("AHRS_ORIENTATION", 4, 0)
    assert made.find() == ()


def test_a_compass_that_undoing_does_not_mend_is_disturbed() -> None:
    made = MadeWithDefaults()
    compasses(made)
    made.drive("COMPASS_ORIENT", 6, 0)
    made.drive("COMPASS_OFS_X", 30, 0)
    made.table["MAG"]["MagX"][made.after(FAILSAFE_S)] += 300
    assert made.find()[0].title == "compass 1 is disturbed"


@pytest.mark.parametrize("number", [1, 2])
def test_an_offset_that_shifts_a_compass(number: int) -> None:
    made = MadeWithDefaults()
    compasses(made)
    name = f"COMPASS_OFS{'' if number == 1 else number}_X"
    made.drive(name, 400, 5)
    made.table["MAG" if number == 1 else "MAG#2"]["MagX"] += 395
    assert made.find()[0].wanted == ((name, 5.0),)


def test_a_small_offset_counts_where_it_kept_the_vehicle_from_arming() -> None:
    made = MadeWithDefaults()
    compasses(made)
    made.drive("COMPASS_OFS_X", 95, 5)
    made.table["MAG"]["MagX"] += 90
    assert not [one for one in made.find() if one.parameters]
    text = "Arm: Check mag field (xy diff:115>100)"
    made.rows = {"MSG": [(t, {"Message": text}) for t in (20.0, 50.0, 80.0)]}
    for name in ("CTUN", "POS"):
        made.table.pop(name)
    assert (made.find()[0].severity, made.find()[0].wanted) == ("critical", (("COMPASS_OFS_X", 5.0),))


def test_a_scale_that_stretches_a_compass() -> None:
    made = MadeWithDefaults()
    compasses(made)
    made.drive("COMPASS_SCALE", 1.4, 1)
    for axis in "XYZ":
        made.table["MAG"][f"Mag{axis}"] *= 1.4
    assert naming(made, "COMPASS_SCALE").wanted == (("COMPASS_SCALE", 1.0),)


def test_a_motor_compensation_that_disturbs_what_it_is_to_mend() -> None:
    made = MadeWithDefaults()
    compasses(made)
    made.drive("COMPASS_MOT_X", 100, 0)
    for table, moved in (("MAG", 1000 * made.table["CTUN"]["ThO"]), ("MAG#2", 0 * made.t)):
        made.table[table] |= {"MOX": moved, "MOY": 0 * moved, "MOZ": 0 * moved}
    made.table["MAG"]["MagX"] += made.table["MAG"]["MOX"]
    assert naming(made, "COMPASS_MOT_X").wanted == (("COMPASS_MOT_X", 0.0),)


@pytest.mark.parametrize("number", [2, 4, 6, 8])
def test_one_compass_alone_is_held_against_how_it_flies(number: int) -> None:
    made = MadeWithDefaults()
    manoeuvre(made)
    made.table.pop("MAG#2")
    compasses(made)
    made.settings["COMPASS_ORIENT"] = 0
    assert not [one for one in made.find() if one.parameters]
    made.settings["COMPASS_ORIENT"] = number
    turn(made, "MAG", mounting(number))
    assert naming(made, "COMPASS_ORIENT").wanted == (("COMPASS_ORIENT", 0.0),)


def test_a_declination_that_somebody_gave() -> None:
    made = MadeWithDefaults()
    manoeuvre(made)
    compasses(made, COMPASS_DEC=0.6)
    made.drive("COMPASS_AUTODEC", 0, 1)
    ((name, value),) = naming(made, "COMPASS_DEC").wanted
    assert name == "COMPASS_DEC"
    assert value == pytest.approx(0.0, abs=0.05)


# --- what stands level


@pytest.mark.parametrize(
    ("parameter", "value", "default", "sensor", "axis"),
    [
        ("INS_ACCOFFS_X", 3.0, 0.0, "IMU", "AccX"),
        ("INS_ACC2OFFS_Y", -3.5, 0.0, "IMU#2", "AccY"),
        ("INS_ACCOFFS_Z", -3.0, 0.0, "IMU", "AccZ"),
        ("INS_ACC2SCAL_Z", 0.8, 1.0, "IMU#2", "AccZ"),
    ],
)
def test_an_accelerometer_that_undoing_mends(
    parameter: str, value: float, default: float, sensor: str, axis: str
) -> None:
    made = MadeWithDefaults()
    made.drive(parameter, value, default)
    made.table[sensor][axis] = (
        made.table[sensor][axis] * value if "SCAL" in parameter else made.table[sensor][axis] - value
    )
    assert naming(made, parameter).wanted == ((parameter, default),)
    assert "the accelerometers disagree" not in [one.title for one in made.find()]


def test_an_accelerometer_that_was_calibrated_is_none() -> None:
    made = MadeWithDefaults()
    made.drive("INS_ACCOFFS_X", 0.4, 0.0)
    made.drive("INS_ACCSCAL_Z", 1.02, 1.0)
    assert made.find() == ()


def test_an_accelerometer_that_undoing_does_not_mend_disagrees() -> None:
    made = MadeWithDefaults()
    made.drive("INS_ACCOFFS_Y", 0.4, 0.0)
    made.table["IMU"]["AccX"] += 5.0
    assert [one.title for one in made.find()] == ["the accelerometers disagree"]


@pytest.mark.parametrize(
    ("parameter", "angle", "trim"), [("AHRS_TRIM_X", "Roll", 0.17), ("AHRS_TRIM_Y", "Pitch", -0.1)]
)
def test_a_trim_that_tilts_what_stands_level(parameter: str, angle: str, trim: float) -> None:
    made = MadeWithDefaults()
    made.settings[parameter] = trim
    for name in (angle, f"Des{angle}"):
        made.table["ATT"][name] -= np.degrees(trim)
    assert naming(made, parameter).wanted == ((parameter, 0.0),)


def test_a_vehicle_that_stands_on_a_slope_has_no_wrong_trim() -> None:
    made = MadeWithDefaults()
    made.settings["AHRS_TRIM_X"] = 0.02
    standing = ~made.after(UP_S)
    made.table["ATT"]["Roll"][standing] = 8.0
    for sensor in ("IMU", "IMU#2"):
        made.table[sensor]["AccY"][standing] = -9.81 * np.sin(np.radians(8.0))
        made.table[sensor]["AccZ"][standing] = -9.81 * np.cos(np.radians(8.0))
    assert not [one for one in made.find() if one.parameters]


def test_gravity_tells_a_board_that_is_told_a_wrong_mounting() -> None:
    made = MadeWithDefaults()
    made.drive("AHRS_ORIENTATION", 8, 0)
    for name in ("MAG", "MAG#2"):
        made.table.pop(name)
    for sensor in ("IMU", "IMU#2"):
        for axis in "YZ":
            made.table[sensor][f"Acc{axis}"] *= -1.0
    assert naming(made, "AHRS_ORIENTATION").wanted == (("AHRS_ORIENTATION", 0.0),)


# --- hovering


def stays_down(made: Made) -> None:
    throttle = np.where(made.after(ARMED_S + 3, DOWN_S), 0.93, 0.0)
    made.table["CTUN"] |= {"ThO": throttle, "Alt": 0 * made.t, "BAlt": 0 * made.t}
    made.table["POS"]["RelHomeAlt"][:] = made.noise(0.02)


@pytest.mark.parametrize(("parameter", "value", "shipped"), [("MOT_SPIN_MAX", 0.6, 0.95), ("MOT_PWM_MAX", 1600, 2000)])
def test_outputs_that_end_before_it_rises(parameter: str, value: float, shipped: float) -> None:
    made = MadeWithDefaults()
    stays_down(made)
    made.drive(parameter, value, shipped)
    assert not [one for one in made.find() if one.parameters]  # the outputs stay well below
    for output in made.table["RCOU"].values():
        output[made.after(ARMED_S + 3, DOWN_S)] = 1600.0
    finding = made.find()[0]
    assert (finding.title, finding.severity) == ("too little thrust to take off", "critical")
    assert finding.wanted == ((parameter, shipped),)
    assert "the outputs end at 1600 us of 2000" in finding.evidence


def test_a_range_that_one_motor_alone_spends_is_that_motors_weakness() -> None:
    made = MadeWithDefaults()
    stays_down(made)
    made.drive("MOT_SPIN_MAX", 0.6, 0.95)
    for number, output in enumerate(made.table["RCOU"].values()):
        output[made.after(ARMED_S + 3, DOWN_S)] = 1600.0 if number == 3 else 1380.0
    assert not [one for one in made.find() if "MOT_SPIN_MAX" in one.parameters]


def test_outputs_that_end_before_it_keeps_its_height() -> None:
    made = MadeWithDefaults()
    high = made.after(30.0, DOWN_S)
    made.table["CTUN"]["ThO"][high] = 0.98
    for name, field in (("CTUN", "Alt"), ("CTUN", "BAlt"), ("BARO", "Alt"), ("BARO#2", "Alt"), ("POS", "RelHomeAlt")):
        made.table[name][field][high] -= 6.0
    made.drive("MOT_PWM_MAX", 1700.0, 2000.0)
    finding = next(one for one in made.find() if one.kind == "thrust")
    assert finding.parameters == (), "the outputs stay well below"
    for output in made.table["RCOU"].values():
        output[high] = 1660.0
    finding = next(one for one in made.find() if one.kind == "thrust")
    assert (finding.suspect, finding.parameters) == ("parameter", ("MOT_PWM_MAX",))
    assert finding.wanted == (("MOT_PWM_MAX", 2000.0),)
    assert "the outputs end at 1665 us of 2000: MOT_PWM_MAX is 1700 (as shipped 2000)" in finding.evidence


def test_a_fence_with_the_radius_as_shipped_was_switched_on() -> None:
    made = MadeWithDefaults()
    made.rows["ERR"] = [(40.0, {"Subsys": 9.0, "ECode": 2.0})]
    made.rows["MODE"] = [(0.0, {"ModeNum": 3.0}), (40.0, {"ModeNum": 6.0})]
    far: dict[str, float | str] = {"CNum": 1.0, "CId": 16.0, "Lat": 47.002, "Lng": 8.0, "Alt": 12.0, "Frame": 3.0}
    made.rows["CMD"] = [(1.0, far)]
    made.drive("FENCE_ENABLE", 1.0, 0.0)
    made.drive("FENCE_RADIUS", 100.0, 100.0)
    assert next(fence.find(made.flight())).parameters == ("FENCE_ENABLE", "FENCE_RADIUS")
    made.drive("FENCE_RADIUS", 100.0, 300.0)
    assert next(fence.find(made.flight())).parameters == ("FENCE_RADIUS",)


def test_a_throttle_that_swings_names_the_gain_that_was_raised() -> None:
    made = MadeWithDefaults()
    flying = made.after(UP_S + 1, DOWN_S - 1)
    made.table["CTUN"]["ThO"][flying] = 0.5 + 0.45 * np.sign(np.sin(8.0 * made.t[flying]))
    assert not [one for one in made.find() if one.parameters]
    assert "the throttle swings" in [one.title for one in made.find()]
    made.rows["MODE"] = [(0.0, {"ModeNum": 0.0})]
    assert "the throttle swings" not in [one.title for one in made.find()]
    made.drive("PSC_ACCZ_D", 0.4, 0.0)
    finding = naming(made, "PSC_ACCZ_D")
    assert (finding.title, finding.wanted) == ("the throttle swings", ())


def test_a_hover_throttle_that_nothing_learns() -> None:
    made = MadeWithDefaults()
    made.drive("MOT_THST_HOVER", 0.15, 0.35)
    made.settings["MOT_HOVER_LEARN"] = 2
    assert made.find() == ()
    made.settings["MOT_HOVER_LEARN"] = 0
    ((name, value),) = naming(made, "MOT_THST_HOVER").wanted
    assert (name, value) == ("MOT_THST_HOVER", HOVER)


@pytest.mark.parametrize(("flown_s", "is_blamed"), [(20.0, False), (90.0, True)])
def test_a_mounting_that_nobody_changed_is_blamed_by_a_long_flight_alone(flown_s: float, *, is_blamed: bool) -> None:
    class Flown:
        flown = ((0.0, flown_s),)

        def default_left(self, _name: str) -> None:
            return None

        def setting(self, _name: str) -> float:
            return 0.0

    class Compass:
        flight, number, mounting, field = Flown(), 1, "COMPASS_ORIENT", np.zeros((3, 1))

        def mounted(self, number: float) -> Any:
            return np.full((3, 1), number)

    def course(field: Any) -> Any:
        return SimpleNamespace(explained=0.95 if field[0, 0] == 2.0 else 0.1, off_deg=0.0)

    found = heading._turned(cast("Any", Compass()), course(np.zeros((3, 1))), course)
    assert (found is not None) is is_blamed

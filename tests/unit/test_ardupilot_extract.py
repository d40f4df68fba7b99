"""Missions and extractors on flights made up here, and the profile on recorded ones."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_core.ecosystems.ardupilot.measures.flown_mission import analyse
from care_core.ecosystems.ardupilot.measures.mission import ArduPilotFlight
from care_core.ecosystems.measures import EXTRACTORS, MISSION_KINDS, Mission, find_extractor
from care_core.ecosystems.registry import run_model
from care_core.ecosystems.statistic import statistic
from care_core.ecosystems.vehicles.way import distance_to_legs
from care_core.logs.base import Table, merge_needs
from care_core.logs.opening import open_log
from care_core.profile.reading import read_schema
from care_core.profile.schema import Schema
from care_core.run import Unavailable, Value, is_known
from care_core.variables import Role
from tests.flights import DOWN_S, END_S, UP_S, Made, flight_of
from tests.tables import read

PROFILE = Path(__file__).parents[2] / "profiles" / "arducopter" / "profile.yaml"
KIND = MISSION_KINDS["ardupilot_flight"]
HOME = (-35.0, 149.0)
METRES = 111_319.49


def table(rows: list[tuple[Any, ...]], *fields: str) -> Table:
    """Rows of (time, field, field, ...) as a table."""
    columns = list(zip(*rows, strict=True)) if rows else [() for _ in range(len(fields) + 1)]
    return Table(
        np.array(columns[0], dtype=float),
        {
            name: np.array(column, dtype=object if any(isinstance(one, str) for one in column) else float)
            for name, column in zip(fields, columns[1:], strict=True)
        },
    )


def north(metres: float) -> float:
    return HOME[0] + metres / METRES


def flight(**replaced: Table | None) -> dict[str, Table]:
    """A square take-off to 20 m, one waypoint 100 m north, and back: armed at 10 s, disarmed at 70 s."""
    path = [(10, 0, 0), (20, 0, 20), (30, 100, 20), (40, 0, 20), (50, 0, 9.5), (69, 0, 0), (75, 0, 0)]
    t, way, height = (np.array(column, dtype=float) for column in zip(*path, strict=True))
    at = np.arange(0.0, 75.0, 0.5)
    position = np.interp(at, t, way)
    level = np.zeros_like(at)
    tables = {
        "ARM": table([(10.0, 1, 0), (70.0, 0, 0)], "ArmState", "Forced"),
        "MSG": table(
            [
                (2.0, "Arm: AHRS: waiting for home"),
                (4.0, "Arm: Need Position Estimate"),
                (20.0, "Mission: 2 WP"),
                (30.0, "Reached command #2"),
                (30.0, "Mission: 3 RTL"),
            ],
            "Message",
        ),
        "CMD": table(
            [(0.0, 1, 22, 0.0, 0.0, 20.0), (0.0, 2, 16, north(100), HOME[1], 20.0), (0.0, 3, 20, 0.0, 0.0, 0.0)],
            "CNum", "CId", "Lat", "Lng", "Alt",
        ),
        "ORGN": table([(10.0, 1, *HOME)], "Type", "Lat", "Lng"),
        "POS": Table(
            at, {"Lat": north(0) + position / METRES, "Lng": level + HOME[1], "RelHomeAlt": np.interp(at, t, height)}
        ),
        "BAT": Table(at, {"Inst": level, "Volt": 12.0 - at / 50, "Curr": level + 36.0, "EnrgTot": 0.12 * at}),
        "ATT": Table(
            at,
            {
                "DesRoll": level + 1.0, "Roll": 1e-9 * at, "DesPitch": level, "Pitch": level - 5.0,
                "DesYaw": level + 359.0, "Yaw": level + 1.0,
            },
        ),
    }  # fmt: skip
    for name, one in replaced.items():
        if one is None:
            tables.pop(name)
        else:
            tables[name] = one
    return tables


SPEC: Mapping[str, Any] = {"waypoints": [[north(100), HOME[1], 20]], "tolerance_m": 5}


def only(tables: Mapping[str, Table], firmware: str = "", **settings: float) -> Mission:
    (mission,) = KIND.missions(*read(tables, 75.0, facts={"firmware": firmware}), SPEC)
    return Mission(mission.model, mission.tables, mission.start_s, mission.end_s, mission.ended, mission.spec, settings)


def value(mission: Mission, kind: str, **args: Any) -> Value:
    return find_extractor(kind).compute(mission, args)


def curved(command: int, turns: float = 0.0) -> dict[str, Table]:
    """The flight with another kind of item in the waypoint's place, flown with a swing of 12 m to the north-east."""
    tables = flight()
    items = tables["CMD"]
    columns = (items[name] for name in ("CNum", "CId", "Lat", "Lng", "Alt"))
    rows = [
        (t, number, command if kind == 16 else kind, lat, lng, alt, turns)
        for t, number, kind, lat, lng, alt in zip(items.t, *columns, strict=True)
    ]
    position = tables["POS"]
    swing = 12.0 * ((position.t > 22.0) & (position.t < 28.0))
    return {
        **tables,
        "CMD": table(rows, "CNum", "CId", "Lat", "Lng", "Alt", "Prm1"),
        "POS": Table(position.t, {**position.columns, "Lng": position["Lng"] + swing / METRES}),
    }


def test_a_landing_ends_the_flight_that_a_mission_asks_for() -> None:
    """Behind it stands what the vehicle flies when it is armed again."""
    tables = flight()
    rows = [
        (0.0, 1, 22, 0.0, 0.0, 20.0),
        (0.0, 2, 16, north(100), HOME[1], 20.0),
        (0.0, 3, 21, north(0), HOME[1], 0.0),
        (0.0, 4, 22, 0.0, 0.0, 20.0),
        (0.0, 5, 16, north(200), HOME[1], 20.0),
        (0.0, 6, 20, 0.0, 0.0, 0.0),
    ]
    items = table(rows, "CNum", "CId", "Lat", "Lng", "Alt")
    first = only({**tables, "CMD": items})
    assert value(first, "waypoints_reached") == 1.0
    assert value(first, "mission_success") == 1.0
    said = [(20.0, "Mission: 5 WP"), (30.0, "Reached command #5"), (30.0, "Mission: 6 RTL")]
    second = only({**tables, "CMD": items, "MSG": table(said, "Message")})
    assert value(second, "mission_success") == 1.0
    asked = value(second, "mission_asked", what="path_length")
    assert isinstance(asked, Unavailable)
    assert "behind a landing" in asked.reason
    on = [(20.0, "Mission: 2 WP"), (30.0, "Reached command #2"), (30.0, "Mission: 3 Land"), (40.0, "Mission: 5 WP")]
    assert value(only({**tables, "CMD": items, "MSG": table(on, "Message")}), "mission_success") == 0.0


def test_a_spline_has_no_straight_leg_to_be_off_from() -> None:
    straight, spline = only(curved(16)), only(curved(82))
    assert value(straight, "path_error") == pytest.approx(11.0, abs=1.0)
    assert value(spline, "path_error") == pytest.approx(0.25, abs=0.25)
    assert value(spline, "waypoints_reached") == 1.0


def test_a_circle_takes_its_time_and_is_no_error_of_the_way() -> None:
    tables, copter = curved(18, turns=2), "ArduCopter V4.5.4"
    assert value(only(tables, copter, CIRCLE_RATE=30.0), "mission_asked", what="hold_time") == pytest.approx(24.0)
    assert value(only(tables, copter), "mission_asked", what="hold_time") == pytest.approx(36.0)
    assert value(only(tables, copter), "path_error") == pytest.approx(0.25, abs=0.25)


def test_a_good_flight() -> None:
    mission = only(flight(), BATT_LOW_VOLT=10.5)
    assert (mission.start_s, mission.end_s, mission.ended) == (10.0, 70.0, True)
    assert KIND.mismatch(mission) == ""
    assert KIND.evidence(mission) == ()
    assert value(mission, "mission_success") == 1.0
    assert value(mission, "mission_time") == 60.0
    assert value(mission, "arming_time") == 8.0
    assert value(mission, "waypoints_reached") == 1.0
    assert value(mission, "energy_used") == pytest.approx(7.2)
    assert value(mission, "min_voltage") == pytest.approx(12.0 - 1.4)
    assert value(mission, "voltage_margin") == pytest.approx(0.1)
    # The positions lie on the legs; the track between them is rounded where this flight turns in an instant.
    assert value(mission, "path_error") == pytest.approx(0.25, abs=0.25)
    assert value(mission, "path_error", stat="mean") == pytest.approx(0.01, abs=0.01)
    assert value(mission, "landing_error") == pytest.approx(0.0, abs=1e-6)
    assert value(mission, "waypoint_miss") == pytest.approx(0.0, abs=1e-6)
    assert value(mission, "distance") == pytest.approx(200.0, abs=0.1)
    assert value(mission, "attitude_error", axis="yaw") == pytest.approx(2.0)
    assert value(mission, "attitude_error", axis="roll", stat="max") == pytest.approx(1.0)
    assert value(mission, "mean_lean_angle") == pytest.approx(5.0)


def test_phases_cover_the_flight() -> None:
    mission = only(flight())
    times = {
        name: value(mission, "phase_time", phase=name) for name in ("takeoff", "return_climb", "return", "descent")
    }
    assert times == {"takeoff": 10.0, "return_climb": 0.0, "return": 10.0, "descent": 10.0}
    assert value(mission, "phase_time", phase="leg", index=1) == 10.0
    assert value(mission, "phase_time", phase="touchdown") == 20.0
    missed = value(mission, "phase_time", phase="leg", index=2)
    assert missed == Unavailable("the flight did not complete 'leg 2'")


def test_energy_is_integrated_where_the_monitor_does_not_count() -> None:
    battery = flight()["BAT"]
    plain = Table(battery.t, {"Volt": 10.0 + 1e-9 * battery.t, "Curr": 36.0 + 1e-9 * battery.t})
    assert value(only(flight(BAT=plain)), "energy_used") == pytest.approx(6.0)


@pytest.mark.parametrize(
    ("replaced", "metric"),
    [
        ({"ARM": table([(10.0, 1, 0), (70.0, 0, 1)], "ArmState", "Forced")}, "forced_disarm"),
        ({"ERR": table([(40.0, 6, 1)], "Subsys", "ECode")}, "failsafe"),
        ({"ERR": table([(40.0, 12, 1)], "Subsys", "ECode")}, "crash"),
        ({"MSG": table([(35.0, "Battery Failsafe")], "Message")}, "failsafe"),
    ],
)
def test_what_makes_a_mission_fail(replaced: dict[str, Table], metric: str) -> None:
    mission = only(flight(**replaced))
    assert value(mission, metric) == 1.0
    assert value(mission, "mission_success") == 0.0
    assert len(KIND.evidence(mission)) == 1


def test_a_cleared_error_is_no_failsafe() -> None:
    mission = only(flight(ERR=table([(40.0, 6, 0), (41.0, 21, 2)], "Subsys", "ECode")))
    assert value(mission, "failsafe") == 0.0
    assert value(mission, "mission_success") == 1.0


def test_a_missed_waypoint_and_a_landing_elsewhere_fail() -> None:
    mission = only(flight(MSG=table([(20.0, "Mission: 2 WP")], "Message")))
    assert (value(mission, "waypoints_reached"), value(mission, "mission_success")) == (0.0, 0.0)
    moved = only(flight(ORGN=table([(10.0, 1, north(-8), HOME[1])], "Type", "Lat", "Lng")))
    assert value(moved, "landing_error") == pytest.approx(8.0)
    assert value(moved, "mission_success") == 0.0


@pytest.mark.parametrize(
    ("firmware", "wait_s", "success"),
    [("APM:Copter V3.5.7", 0.0, 1.0), ("APM:Copter V3.5.7", 5.0, 0.0), ("ArduCopter V4.5.4", 0.0, 0.0)],
)
def test_a_copter_on_its_leash_lands_short_of_its_last_waypoint(firmware: str, wait_s: float, success: float) -> None:
    rows = [(1, 22, 0.0, 0.0, 20.0, 0.0), (2, 16, north(8), HOME[1], 20.0, wait_s), (3, 21, 0.0, 0.0, 0.0, 0.0)]
    items = table([(0.0, *row) for row in rows], "CNum", "CId", "Lat", "Lng", "Alt", "Prm1")
    mission = only({**flight(), "CMD": items}, firmware)
    assert value(mission, "landing_error") == pytest.approx(8.0)
    assert value(mission, "mission_success") == success


def test_a_log_that_ends_in_flight_has_no_success() -> None:
    mission = only(flight(ARM=table([(10.0, 1, 0)], "ArmState", "Forced")))
    assert not mission.ended
    assert isinstance(value(mission, "mission_success"), Unavailable)


def test_arming_by_events_and_more_than_one_flight() -> None:
    events = table([(5.0, 10), (6.0, 15), (8.0, 11), (10.0, 10), (70.0, 11)], "Id")
    missions = KIND.missions(*read(flight(ARM=None, EV=events), 75.0), SPEC)
    assert [(one.start_s, one.end_s, one.ended) for one in missions] == [(5.0, 8.0, True), (10.0, 70.0, True)]


def test_a_log_that_begins_armed_holds_a_flight_whole_where_it_stood_then() -> None:
    made = Made()
    made.rows["ARM"] = made.rows["ARM"][1:]
    del made.rows["MSG"]  # which tells of the arming

    def spans(first_s: float) -> list[tuple[float, float]]:
        tables = {name: one.where(one.t >= first_s) for name, one in made.tables().items()}
        shifted = {name: Table(one.t - first_s, one.columns) for name, one in tables.items() if len(one)}
        flown = flight_of(shifted, made.known, made.facts, END_S - first_s)
        return [(one.start_s, one.end_s) for one in KIND.missions(flown, shifted, {})]

    assert spans(UP_S - 4.0) == [(0.0, DOWN_S + 5 - (UP_S - 4.0))]
    assert spans(30.0) == [], "it flew already"


def test_refused_arming_is_one_mission_with_the_last_reasons() -> None:
    texts = table(
        [
            (2.0, "Arm: Gyros inconsistent"),
            (30.0, "PreArm: Check ANGLE_MAX"),
            (30.0, "PreArm: RC not calibrated"),
            (50.0, "Arm: AHRS: waiting for home"),
            (50.0, "Arm: Check ANGLE_MAX"),
        ],
        "Message",
    )
    mission = only({"MSG": texts})
    assert (mission.start_s, mission.end_s, mission.ended) == (0.0, 75.0, True)
    assert [(one.text, one.kind) for one in KIND.evidence(mission)] == [
        ("Arm: AHRS: waiting for home", "refusal"),
        ("Arm: Check ANGLE_MAX", "refusal"),
    ]
    assert value(mission, "arming_refused") == 1.0
    assert value(mission, "arming_refused", text="angle_max") == 1.0
    assert value(mission, "arming_refused", text="Gyros") == 0.0
    assert value(mission, "mission_success") == 0.0
    assert value(mission, "mission_time") == Unavailable("the vehicle never armed", "see why arming was refused")


def test_a_refusal_stands_though_the_log_breaks_off() -> None:
    whole = only({"MSG": table([(30.0, "Arm: Gyros not calibrated")], "Message")})
    cut = Mission(whole.model, whole.tables, whole.start_s, whole.end_s, False, whole.spec, {})
    assert KIND.is_decided(cut)
    unasked = only({"MSG": table([(30.0, "PreArm: Gyros not calibrated")], "Message")})
    assert not KIND.is_decided(Mission(unasked.model, unasked.tables, 0.0, unasked.end_s, False, unasked.spec, {}))


def test_a_vehicle_that_nobody_tried_to_arm_lost_no_mission() -> None:
    texts = [(30.0, "PreArm: RC not found"), (60.0, "PreArm: RC not found")]
    found = value(only({"MSG": table(texts, "Message")}), "mission_success")
    assert isinstance(found, Unavailable)
    assert "its firmware does not say whether anybody asked it to; it would refuse: RC not found" in found.reason


def test_a_refusal_before_arming_is_no_evidence() -> None:
    assert value(only(flight()), "arming_refused") == 0.0


def test_a_log_without_arming_or_refusal_holds_no_mission() -> None:
    assert KIND.missions(*read({"MSG": table([(1.0, "ArduCopter V4.5.4")], "Message")}, 9.0), SPEC) == ()


def test_statistics_of_a_hundred_and_one_values() -> None:
    """Each of its own, so that none stands for another."""
    ramp = np.arange(101.0) - 20.0
    found = {name: statistic(ramp, name) for name in ("mean", "max", "min", "std", "rms", "peak")}
    assert found == pytest.approx(
        {"mean": 30, "max": 80, "min": -20, "std": 29.155, "rms": 41.833, "peak": 75}, rel=1e-4
    )


def test_another_mission_is_named() -> None:
    other = flight()["CMD"]
    far = Table(other.t, {**other.columns, "Lat": np.array([0.0, north(160), 0.0])})
    assert KIND.mismatch(only(flight(CMD=far))) == "waypoint 1 is 60 m from where the profile's mission has it"
    assert "has 0 waypoints" in KIND.mismatch(only(flight(CMD=None)))


@pytest.mark.parametrize("lost", ["POS", "BAT", "ATT", "CMD", "ORGN", "MSG", "ARM"])
def test_a_missing_channel_never_raises_and_never_gives_a_number_of_it(lost: str) -> None:
    schema = read_schema(PROFILE)
    for mission in KIND.missions(*read(flight(**{lost: None}), 75.0), SPEC):
        for variable in schema.variables.values():
            if variable.extract is not None:
                found = value(mission, variable.extract.kind, **variable.extract.args)
                assert isinstance(found, Unavailable) or np.isfinite(found)
    if lost != "ARM":
        mission = only(flight(**{lost: None}))
        gone = {"POS": "path_error", "BAT": "energy_used", "ATT": "attitude_error", "CMD": "waypoints_reached"}
        if lost in gone:
            assert isinstance(value(mission, gone[lost]), Unavailable)


@given(st.lists(st.tuples(st.floats(-500, 500), st.floats(-500, 500)), min_size=2, max_size=6), st.floats(0, 1))
def test_points_on_a_leg_have_no_path_error(corners: list[tuple[float, float]], share: float) -> None:
    legs = np.array(corners)
    points = legs[:-1] + share * np.diff(legs, axis=0)
    assert np.all(distance_to_legs(points, legs) < 1e-4)  # metres: legs shorter than that are points
    assert np.all(distance_to_legs(points + 3000.0, legs) > 1000.0)


def test_the_profile_reads_no_simulator_and_names_known_extractors() -> None:
    schema = read_schema(PROFILE)
    assert len(schema.options) == 33
    assert "SIM_" not in PROFILE.read_text(encoding="utf-8")
    for variable in schema.variables.values():
        if variable.role is Role.OPTION:
            assert variable.default is not None
            assert variable.accepts(variable.default)
            assert variable.doc
        else:
            assert variable.extract is not None
            assert variable.extract.kind in EXTRACTORS
            # What was asked comes in many units.
            assert variable.extract.kind == "mission_asked" or variable.unit == EXTRACTORS[variable.extract.kind].unit
    assert all(option in schema.variables for rule in schema.evidence for option in rule.options)
    assert schema.variables["BATT_LOW_VOLT"].safety


def test_every_extractor_is_documented() -> None:
    assert all(one.doc for one in EXTRACTORS.values())


SHARED = os.environ.get("CARE_SHARED")
needs_data = pytest.mark.skipif(SHARED is None, reason="CARE_SHARED names no folder of recorded runs")


def recorded(path: Path, schema: Schema) -> tuple[Mission, dict[str, Value]]:
    log = open_log(path)
    model = run_model(log)
    extracts = {name: one.extract for name, one in schema.variables.items() if one.extract is not None}
    needs = [KIND.needs(schema.mission), *(find_extractor(e.kind).needs(e.args) for e in extracts.values())]
    last = KIND.missions(model, model.tables(merge_needs(needs)), schema.mission)[-1]
    settings = {name: history[-1].value for name, history in log.settings().items()}
    mission = Mission(last.model, last.tables, last.start_s, last.end_s, last.ended, last.spec, settings)
    return mission, {name: find_extractor(e.kind).compute(mission, e.args) for name, e in extracts.items()}


def faults(count: int) -> Iterator[dict[str, Any]]:
    with Path(SHARED or "", "data", "arducopter", "faults", "truth.jsonl").open(encoding="utf-8") as lines:
        for line, _ in zip(lines, range(count), strict=False):
            yield json.loads(line)


@needs_data
def test_recorded_faults_agree_with_what_was_measured_outside() -> None:
    schema = read_schema(PROFILE)
    for fault in faults(12):
        log = Path(SHARED or "", "data", "arducopter", "faults", f"{fault['tag']}.BIN")
        mission, values = recorded(log, schema)
        truth = fault["objectives"]
        assert KIND.mismatch(mission) == ""
        assert values["mission_success"] == truth["mission_success"], fault["tag"]
        if truth["outcome"] == "arm_failed":
            assert all(one.kind == "refusal" for one in KIND.evidence(mission))
            assert KIND.evidence(mission)
            continue
        time_s, energy_wh = values["mission_time"], values["energy"]
        assert is_known(time_s)
        assert is_known(energy_wh)
        assert time_s == pytest.approx(truth["mission_time_s"], abs=0.4)
        assert energy_wh == pytest.approx(truth["energy_wh"], abs=0.05)
        assert mission.shared(analyse).track is not None


@needs_data
def test_recorded_options_are_those_that_were_flown() -> None:
    schema = read_schema(PROFILE)
    for fault in faults(6):
        found = open_log(Path(SHARED or "", "data", "arducopter", "faults", f"{fault['tag']}.BIN")).settings()
        for option in schema.options:
            driven = found[option.parameters[0]][-1].value
            assert driven == pytest.approx(fault["config"][option.name], rel=1e-3), (fault["tag"], option.name)


@needs_data
def test_ranges_and_defaults_are_the_sampled_ones() -> None:
    schema = read_schema(PROFILE)
    with Path(SHARED or "", "data", "arducopter", "reference.csv").open(encoding="utf-8") as stream:
        for row in csv.DictReader(stream):
            option = schema.variables[row["option"]]
            assert option.default == float(row["reference"])
            assert option.range == (float(row["low"]), float(row["high"]))


def test_the_mission_kind_is_registered() -> None:
    assert isinstance(KIND, ArduPilotFlight)

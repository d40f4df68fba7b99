"""A number is one of the span that it is said of: what the log holds of half of it is not judged as the whole."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from care_core.ecosystems import examine as examining
from care_core.ecosystems.coverage import EXTREME, MEAN, SUM, Samples, doubt, unseen, usual_pause
from care_core.ecosystems.examine import examine
from care_core.ecosystems.findings import NOT_FLOWN, Finding, FindingKind, Health, Severity
from care_core.ecosystems.measures import MISSION_KINDS, Args, Mission, find_extractor
from care_core.ecosystems.registry import run_model
from care_core.extract.plain import read_plain_runs
from care_core.extract.read import read_run
from care_core.logs import formats
from care_core.logs.base import Table
from care_core.logs.opening import open_log
from care_core.profile.reading import read_schema
from care_core.run import Unavailable, Value
from tests.flights import ARMED_S, DOWN_S, FACTS, Made
from tests.goal_drives import drive
from tests.tables import TablesLog, no_model, read

PROFILES = Path(__file__).resolve().parents[2] / "profiles"

START_S, STOP_S = ARMED_S, DOWN_S + 5
TOTAL_S = STOP_S - START_S


def steady(hz: float, start: float = 0.0, end: float = 200.0) -> np.ndarray:
    return np.arange(start, end, 1 / hz)


def without(t: np.ndarray, start: float, end: float) -> np.ndarray:
    return t[(t < start) | (t > end)]


def reason(t: np.ndarray, **given: Any) -> str:
    why = doubt(Samples("the battery (BAT)", t, ((30.0, 201.0),) if "moments" not in given else (), **given))
    return "" if why is None else why.reason


def test_samples_of_the_last_eighth_are_not_the_whole() -> None:
    assert reason(steady(2, 180.0, 201.0)) == "the battery (BAT) was recorded for 21 of 171 s"


def test_a_hole_in_the_middle_counts_and_its_seconds_are_told() -> None:
    assert reason(without(steady(10, 0, 201), 60, 105)) == "the battery (BAT) was recorded for 126 of 171 s"


@pytest.mark.parametrize("hz", [0.2, 0.5, 1.0, 4.0, 400.0])
def test_a_stream_however_slow_covers_what_it_spans(hz: float) -> None:
    assert not reason(steady(hz, 0.0, 201.0))


def test_a_card_that_stalls_for_a_second_now_and_then_loses_nothing() -> None:
    t = steady(10, 0, 201)
    for at in range(40, 200, 20):
        t = without(t, at, at + 1.5)
    assert not reason(t)


def test_a_lossy_link_whose_pauses_vary_is_no_hole() -> None:
    rng = np.random.default_rng(0)
    t = np.cumsum(rng.exponential(1.0, 250))
    assert not reason(t[t < 201])


def test_a_greatest_value_bears_less_than_a_mean() -> None:
    t = without(steady(10, 0, 201), 60, 73)
    assert reason(t, bears=EXTREME)
    assert not reason(t, bears=MEAN)


def test_what_comes_between_two_samples_outside_of_the_span_covers_it() -> None:
    assert unseen(np.array([0.0, 10.0, 20.0]), [(11.0, 12.0)], usual_pause(np.array([0.0, 10.0, 20.0]))) == 0


def test_a_sample_at_a_moment_must_be_near_it() -> None:
    assert not reason(steady(2, 0, 150), moments=[150.5])
    assert "50 s off" in reason(steady(2, 0, 150), moments=[200.0])


def test_what_only_repeats_itself_is_as_good_as_not_recorded() -> None:
    said = reason(steady(10, 0, 201), dead=((60.0, 200.0),))
    assert said == "the battery (BAT) says the same from 60 s to 200 s (3:20), so it measures nothing then"
    assert not reason(steady(10, 0, 201), dead=((60.0, 62.0),))


# ArduPilot


def flown(change: Callable[[dict[str, Table]], None] = lambda _: None) -> Mission:
    made = Made()
    made.table["POS"]["Lng"] += made.noise(1e-8)
    made.rows["CMD"] = [
        (1.0, {"CNum": 1.0, "CId": 22.0, "Lat": 0.0, "Lng": 0.0, "Alt": 12.0}),
        (1.0, {"CNum": 2.0, "CId": 16.0, "Lat": 47.0 + 160 / 111_319.5, "Lng": 8.0, "Alt": 12.0}),
        (1.0, {"CNum": 3.0, "CId": 20.0, "Lat": 0.0, "Lng": 0.0, "Alt": 0.0}),
    ]
    made.rows["ORGN"] = [(ARMED_S, {"Type": 1.0, "Lat": 47.0, "Lng": 8.0})]
    made.rows["MODE"] = [(0.0, {"ModeNum": 3.0})]
    made.rows["MSG"] = [(20.0, {"Message": "Mission: 2 WP"}), (60.0, {"Message": "Reached command #2"})]
    tables = made.tables()
    change(tables)
    model = run_model(TablesLog(tables, 110.0, formats.DATAFLASH_BIN, FACTS, made.known))
    (mission,) = MISSION_KINDS["ardupilot_flight"].missions(model, model.log.read(every(tables)), {})
    return mission


def every(tables: Mapping[str, Table]) -> dict[str, tuple[str, ...]]:
    return {name: tuple(table.columns) for name, table in tables.items()}


def cut(name: str, start: float, end: float) -> Callable[[dict[str, Table]], None]:
    def change(tables: dict[str, Table]) -> None:
        tables[name] = tables[name].where((tables[name].t < start) | (tables[name].t > end))

    return change


def measure(mission: Mission, kind: str, args: Args) -> Value:
    return find_extractor(kind).compute(mission, args)


MEASURES: tuple[tuple[str, str, Args], ...] = (
    ("energy_used", "BAT", {}),
    ("min_voltage", "BAT", {}),
    ("hover_power", "BAT", {}),
    ("path_error", "POS", {}),
    ("path_error", "POS", {"stat": "mean"}),
    ("waypoint_miss", "POS", {}),
    ("distance", "POS", {}),
    ("attitude_error", "ATT", {}),
    ("lean_angle", "ATT", {}),
    ("mean_lean_angle", "ATT", {}),
    ("motor_output", "RCOU", {}),
    ("vibration", "VIBE", {}),
    ("throttle", "CTUN", {}),
    ("gps_quality", "GPS", {}),
    ("ekf_innovation", "XKF4", {}),
)


@pytest.mark.parametrize(("kind", "channel", "args"), MEASURES)
@pytest.mark.parametrize("lost", [(0.0, 60.0), (40.0, 85.0), (55.0, 110.0)], ids=["begins late", "hole", "ends early"])
def test_a_measure_of_half_a_flight_is_none(
    kind: str, channel: str, args: Args, lost: tuple[float, float]
) -> None:  # fmt: skip
    whole = measure(flown(), kind, args)
    assert isinstance(whole, float), whole
    part = measure(flown(cut(channel, *lost)), kind, args)
    assert isinstance(part, Unavailable)
    assert " s" in part.reason


@pytest.mark.parametrize(("kind", "channel", "args"), MEASURES)
def test_a_pause_of_a_second_and_a_half_costs_no_measure(kind: str, channel: str, args: Args) -> None:
    assert isinstance(measure(flown(cut(channel, 50.0, 51.5)), kind, args), float)


def test_a_time_between_two_events_needs_no_samples_between() -> None:
    def change(tables: dict[str, Table]) -> None:
        for name in ("POS", "BAT", "ATT"):
            cut(name, 40, 85)(tables)

    assert measure(flown(change), "mission_time", {}) == TOTAL_S


def test_where_it_landed_is_not_known_of_a_position_that_ends_before() -> None:
    assert isinstance(measure(flown(cut("POS", 0, 60)), "landing_error", {}), float)
    assert "not recorded when it counts" in str(measure(flown(cut("POS", 60, 110)), "landing_error", {}))


def test_a_hole_in_all_of_a_log_may_hide_an_event() -> None:
    def change(tables: dict[str, Table]) -> None:
        for name in list(tables):
            cut(name, 40, 80)(tables)

    mission = flown(change)
    assert measure(mission, "failsafe", {}) == Unavailable(
        "the flight was recorded for 60 of 100 s", "record it from start to end"
    )
    success = measure(mission, "mission_success", {})
    assert isinstance(success, Unavailable), "its waypoint was reached while nothing was recorded"


def test_a_controller_that_is_silent_while_it_does_not_steer_leaves_no_hole() -> None:
    def change(tables: dict[str, Table]) -> None:
        t = tables["POS"].t[200:600]
        for axis in "NE":
            tables[f"PSC{axis}"] = Table(t, {f"V{axis}": np.ones(len(t)), f"TV{axis}": np.full(len(t), 2.0)})

    assert isinstance(measure(flown(change), "velocity_error", {}), float)


def test_health_says_which_sources_it_saw_a_part_of() -> None:
    titles = [one.title for one in examine(flown(cut("BAT", 0, 85)).model).findings]
    assert "the battery (BAT) was recorded for 20 of 100 s" in titles
    assert not [one.title for one in examine(flown().model).findings if "recorded" in one.title]


# Any recording


def signal(t: np.ndarray, kind: formats.LogFormat, channel: str, stat: str) -> Value:
    tables = {channel: Table(t, {"x": np.sin(t)})}
    model, found = read(tables, 100.0, kind)
    return measure(
        Mission(model, found, 0.0, 100.0, True, {}), "signal", {"channel": channel, "field": "x", "stat": stat}
    )


@pytest.mark.parametrize("stat", ["mean", "max", "min", "rms", "std", "first", "change"])
def test_a_statistic_of_a_field_needs_the_whole_mission(stat: str) -> None:
    assert isinstance(signal(steady(5, 0, 100), formats.PX4_ULG, "battery_status", stat), float)
    assert isinstance(signal(steady(5, 60, 100), formats.PX4_ULG, "battery_status", stat), Unavailable)


def test_the_last_value_needs_the_end_only() -> None:
    assert isinstance(signal(steady(5, 60, 100), formats.PX4_ULG, "battery_status", "last"), float)


@pytest.mark.parametrize("channel", ["logged_messages", "mission_result"])
def test_what_speaks_at_times_is_not_to_speak_always(channel: str) -> None:
    assert isinstance(signal(steady(5, 60, 100), formats.PX4_ULG, channel, "mean"), float)


def test_what_never_came_steadily_has_no_holes() -> None:
    t = np.array([1.0, 1.1, 1.2, 20.0, 20.1, 50.0, 50.1, 50.2, 50.3, 51.0, 90.0, 90.1, 91.0])
    assert isinstance(signal(t, formats.PX4_ULG, "wheel_event", "mean"), float)


def test_a_px4_flight_with_a_hole_is_not_said_to_have_had_no_failsafe() -> None:
    def log(t: np.ndarray) -> TablesLog:
        status = {"arming_state": np.where((t > 5) & (t < 95), 2.0, 1.0), "nav_state": np.full(len(t), 4.0),
                  "failsafe": np.zeros(len(t))}  # fmt: skip
        place = {"z": -np.interp(t, [10, 20, 80, 90], [0, 10, 10, 0])}
        landed = {"landed": np.where((t > 10) & (t < 90), 0.0, 1.0)}
        tables = {"vehicle_status": Table(t, status), "vehicle_local_position": Table(t, place),
                  "vehicle_land_detected": Table(t, landed)}  # fmt: skip
        return TablesLog(tables, 100.0, formats.PX4_ULG, {"vehicle": "multicopter"})

    def failsafe(t: np.ndarray) -> Value:
        (run,) = read_plain_runs(run_model(log(t)), lambda: "")
        return {check.name: check.value for check in run.checks}["no_failsafe"]

    assert failsafe(steady(5, 0, 100)) == 1.0
    assert isinstance(failsafe(without(steady(5, 0, 100), 30, 75)), Unavailable)
    assert SUM.of(90.0) == 4.5


# ROS

GOALS = ((8.0, 0.0), (16.0, 0.0))


def run(folder: Path, **silent: tuple[float, float]) -> Mapping[str, Value]:
    """Metrics and objectives of a drive of 40 s whose topics are silent between two times."""
    topics = {f"/{name}": times for name, times in silent.items()}
    log = open_log(drive(folder / "drive.bag", GOALS, silent=topics))
    found = read_run(run_model(log), read_schema(PROFILES / "move_base" / "profile.yaml"))
    return {**found.metrics, **found.objectives}


@pytest.mark.parametrize("lost", [(0.0, 30.0), (12.0, 35.0), (20.0, 60.0)], ids=["begins late", "hole", "ends early"])
def test_half_a_battery_is_no_energy_of_a_drive(lost: tuple[float, float], tmp_path: Path) -> None:
    assert isinstance(run(tmp_path)["energy"], float)
    (tmp_path / "drive.bag").unlink()
    energy = run(tmp_path, battery_state=lost)["energy"]
    assert isinstance(energy, Unavailable)
    assert energy.reason.startswith("the battery (/battery_state) was recorded for ")


def test_half_an_odometry_measures_no_path(tmp_path: Path) -> None:
    whole = run(tmp_path)
    (tmp_path / "drive.bag").unlink()
    part = run(tmp_path, odom=(12.0, 35.0))
    lost = {name for name, value in part.items() if isinstance(value, Unavailable) and isinstance(whole[name], float)}
    assert {"traveled_distance", "top_speed", "standstill_share", "distance_left", "blocked_share"} <= lost
    assert isinstance(part["mission_success"], float), "goals are told by their server"
    assert isinstance(part["mission_time"], float)


def test_commands_are_silent_while_the_robot_stands(tmp_path: Path) -> None:
    """Beside its first goal the robot stands for 4 s."""
    whole = run(tmp_path)
    (tmp_path / "drive.bag").unlink()
    part = run(tmp_path, cmd_vel=(18.2, 21.8))
    assert [name for name, value in part.items() if isinstance(value, Unavailable)] == [
        name for name, value in whole.items() if isinstance(value, Unavailable)
    ]


def test_an_answer_may_have_come_while_nothing_was_recorded(tmp_path: Path) -> None:
    """The second goal is answered at 42 s."""
    hole = (30.0, 44.0)
    everything = dict.fromkeys(("odom", "cmd_vel", "battery_state", "move_base/result"), hole)
    success = run(tmp_path, **everything)["mission_success"]
    assert success == Unavailable("the drive was recorded for 10 of 24 s", "record it from start to end")


def test_energy_of_two_batteries_needs_the_whole_record_of_both() -> None:
    def second(until_s: float) -> Callable[[dict[str, Table]], None]:
        def change(tables: dict[str, Table]) -> None:
            first = tables["BAT"]
            other = first.where(first.t < until_s)
            t = np.concatenate((first.t, other.t))
            order = np.argsort(t, kind="stable")
            columns = {name: np.concatenate((first[name], other[name]))[order] for name in first.columns}
            columns["Inst"] = np.concatenate((np.zeros(len(first)), np.ones(len(other))))[order]
            tables["BAT"] = Table(t[order], columns)

        return change

    energy = find_extractor("energy_used").compute
    assert isinstance(energy(flown(second(1e9)), {}), float)
    assert isinstance(energy(flown(second(40.0)), {}), Unavailable)


@pytest.mark.parametrize(
    ("kind", "severity", "answers"), [("log", "warning", False), ("prearm", "warning", True), ("log", "critical", True)]
)
def test_that_nothing_was_flown_is_told_unless_something_answers_why(
    kind: FindingKind, severity: Severity, answers: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = Finding(kind, "told", 1.0, 2.0, severity, "", "")
    health = Health("", (), (one,), too_little=NOT_FLOWN)
    monkeypatch.setattr(examining, "ecosystem_of", lambda _: SimpleNamespace(examine=lambda _: health))
    titles = [one.title for one in examining.examine(no_model()).findings]
    assert titles == (["told"] if answers else ["told", NOT_FLOWN])

"""What is read of a plane's flight: planted waypoints, a circle and a landing with a straight final."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from care_core.ecosystems.ardupilot.measures import hover, whole_way, winged  # noqa: F401  they register their extractors
from care_core.ecosystems.ardupilot.measures.flown_mission import analyse
from care_core.ecosystems.ardupilot.measures.shortfall import short_of
from care_core.ecosystems.measures import MISSION_KINDS, Mission, find_extractor
from care_core.logs.base import Table
from care_core.records import replace
from care_core.run import Unavailable, Value
from tests.tables import read

KIND = MISSION_KINDS["ardupilot_flight"]
HOME = (47.0, 8.0)
METRES = 111_319.49
EAST = METRES * math.cos(math.radians(HOME[0]))
# North, east and height of the waypoints: a square, then two on the straight that leads home.
WAY = [(300.0, 0.0, 60.0), (300.0, 300.0, 60.0), (0.0, 300.0, 80.0), (-600.0, 0.0, 60.0), (-300.0, 0.0, 30.0)]
REACHED_S = [25.0, 40.0, 55.0, 90.0, 105.0]
AT = np.arange(0.0, 140.0, 0.4)


def table(rows: list[tuple[Any, ...]], *fields: str) -> Table:
    columns = list(zip(*rows, strict=True))
    typed = (np.array(column, dtype=object if isinstance(column[0], str) else float) for column in columns[1:])
    return Table(np.array(columns[0], dtype=float), dict(zip(fields, typed, strict=True)))


def flown(**replaced: Table) -> dict[str, Table]:
    """Armed at 5 s, off the ground at 10 s; 20 m/s on the legs, 10 m beside the second one; a circle between 55 and
    58 s; down and disarmed at 130 s."""
    north = np.interp(AT, [10, *REACHED_S[:3], 58, *REACHED_S[3:], 120], [0, 300, 300, 0, 0, -600, -300, 0])
    east = np.interp(AT, [10, *REACHED_S[:3], 58, *REACHED_S[3:], 120], [0, 0, 300, 300, 300, 0, 0, 0])
    north = north + np.interp(AT, [28, 30, 35, 37], [0, 10, 10, 0])
    height = np.interp(AT, [10, 20, 105, 120], [0, 60, 30, 0])
    ones = np.ones_like(AT)
    items = [(22, 15.0, 0.0, 0.0, 40.0)]
    for k, (n, e, up) in enumerate(WAY):
        items.append((16, 0.0, HOME[0] + n / METRES, HOME[1] + e / EAST, up))
        if k == 2:
            items.append((18, 2.0, HOME[0] + n / METRES, HOME[1] + e / EAST, up))
    items.append((21, 0.0, *HOME, 0.0))
    numbers = [2, 3, 4, 6, 7]
    texts = [(20.0, "Mission: 2 WP")]
    for number, t in zip(numbers, REACHED_S, strict=True):
        said = "Passed waypoint #%d dist 3m" if number == 3 else "Reached waypoint #%d dist 40m"
        texts.append((t, said % number))
        texts.append((t, f"Mission: {number + 1} " + {4: "LoitTurns", 7: "Land"}.get(number, "WP")))
    texts.append((58.0, "Mission: 6 WP"))
    tables = {
        "ARM": table([(5.0, 1, 0), (130.0, 0, 0)], "ArmState", "Forced"),
        "MODE": table([(0.0, 10)], "ModeNum"),
        "MSG": table(sorted(texts), "Message"),
        "CMD": table(
            [(0.0, 0, 16, 0.0, 0.0, *HOME, 0.0), *((0.0, k, c, p, 0.0, la, lo, up) for k, (c, p, la, lo, up)
             in enumerate(items, start=1))], "CNum", "CId", "Prm1", "Prm2", "Lat", "Lng", "Alt",
        ),
        "ORGN": table([(0.0, 1, *HOME, 500.0)], "Type", "Lat", "Lng", "Alt"),
        "POS": Table(AT, {"Lat": HOME[0] + north / METRES, "Lng": HOME[1] + east / EAST, "RelHomeAlt": height}),
        "CTUN": Table(AT, {"As": 19.0 * ones, "ThO": np.where(AT < 20, 100.0, 45.0)}),
        "NTUN": Table(AT, {"AltE": np.where((AT > 26) & (AT < 39), -4.0, 2.0), "XT": 3.0 * ones, "TAsp": 20.0 * ones}),
        "AETR": Table(AT, {"Ail": 450.0 * ones, "Elev": np.where(AT < 47, 4500.0, 0.0), "Thr": 45.0 * ones}),
        "ATT": Table(AT, {"Roll": np.sin(AT), "Pitch": np.cos(AT), "Yaw": 10 * AT}),
        "TECS": Table(AT, {"dh": 0.2 * ones, "dhdem": 0.5 * ones}),
        "BAT": Table(AT, {"Volt": 12.0 * ones, "Curr": 10.0 * ones}),
        "XKF2": Table(AT, {"C": 0 * ones, "VWN": 3.0 * ones, "VWE": 4.0 * ones}),
        "PIDR": Table(AT, {"Tar": 5.0 * ones, "Act": 3.0 * ones}),
        "PIDP": Table(AT, {"Tar": ones, "Act": ones}),
        "RATE": Table(AT[AT < 20], {"RDes": 1 + 0 * AT[AT < 20], "R": 0 * AT[AT < 20]}),
    }  # fmt: skip
    return {**tables, **replaced}


def mission(facts: str = "ArduPlane V4.5.4", **replaced: Table) -> Mission:
    (found,) = KIND.missions(*read(flown(**replaced), 140.0, facts={"firmware": facts}), {"tolerance_m": 150})
    return found


def value(kind: str, /, flight: Mission | None = None, **args: Any) -> Value:
    return find_extractor(kind).compute(mission() if flight is None else flight, args)


def test_the_straight_final_and_the_first_leg_are_not_judged() -> None:
    legs = winged.legs_of(mission())
    assert not isinstance(legs, Unavailable)
    assert [leg.length for leg in legs.legs.values()] == pytest.approx([300.0, 300.0], abs=0.1)
    assert legs.spans == {2: (25.0, 40.0), 3: (40.0, 55.0)}


def test_a_leg_begins_where_the_circle_before_it_is() -> None:
    """The circle of item 3 stands 200 m beside the line between the waypoints around it."""
    tables = flown()
    command = tables["CMD"].columns
    circle, waypoint = command["CNum"] == 3, command["CNum"] == 2
    command["CId"][circle] = 19
    command["Lat"][circle] = command["Lat"][waypoint] + 200.0 / METRES
    command["Lng"][circle] = command["Lng"][waypoint]
    flight = mission(CMD=tables["CMD"])
    legs = winged.legs_of(flight)
    assert not isinstance(legs, Unavailable)
    assert legs.after_loiter == 1.0
    (leg,) = legs.legs.values()
    assert leg.start.circle == 1.0
    assert leg.length == pytest.approx(math.hypot(500.0, 300.0), abs=0.1)
    assert value("sharpest_corner", flight) == pytest.approx(0.0, abs=0.1), "a plane leaves a circle in any direction"
    assert value("legs_asked", flight, what="loiters") == 1.0
    assert value("legs_asked", flight, what="first_rise") == 0.0, "in the circle it has the time to climb"


def test_a_waypoint_that_was_passed_counts() -> None:
    assert mission().shared(analyse).reached == 5
    assert value("mission_success") == 1.0


@pytest.mark.parametrize(("kind", "args", "expected"), [
    ("leg_error", {}, 10.15),
    ("leg_speed", {}, 600.0 / 30.0),
    ("airspeed", {}, 19.0),
    ("airspeed_error", {}, 1.0),
    ("crosstrack_error", {}, 3.0),
    ("plane_throttle", {}, 45.0),
    ("plane_throttle_saturation", {}, 0.0),
    ("climb_error", {}, 0.3),
    ("surface_output", {"axis": "roll"}, 0.1),
    ("surface_rate_error", {"axis": "roll"}, 2.0),
    ("surface_rate_error", {"axis": "pitch"}, 0.0),
    ("wind_speed", {}, 5.0),
    ("loiter_turns", {}, 2.0),
    ("sharpest_corner", {}, 90.0),
    ("never_climbed", {}, 0.0),
    ("level_power", {"airspeed": 19.0}, 120.0),
    ("level_power", {"airspeed": 38.0}, 960.0),
    ("assisted", {}, 0.0),
    ("hover_rate_error", {"axis": "roll"}, 1.0),
])  # fmt: skip
def test_measures(kind: str, args: dict[str, Any], expected: float) -> None:
    assert value(kind, **args) == pytest.approx(expected, abs=0.02)


def test_a_height_is_off_by_its_mean_size() -> None:
    off = value("height_error")
    assert isinstance(off, float)
    assert 2.5 < off < 3.5


def test_a_plane_that_stays_on_the_ground_never_climbed() -> None:
    tables = flown()
    tables["POS"].columns["RelHomeAlt"][:] = 0.3
    assert value("never_climbed", mission(POS=tables["POS"])) == 1.0


def test_firmware_that_says_nothing_of_its_items_writes_each_as_it_begins_it() -> None:
    tables = flown()
    items = tables["CMD"]
    begun = [1, 2, 3, 4]
    old = {name: column[begun] for name, column in items.columns.items()}
    cmd = Table(np.array([10.0, 20.0, 25.0, 40.0]), old)
    quad = mission("ArduCopter V3.2.1", CMD=cmd, MSG=Table(np.empty(0), {}), MODE=table([(0.0, 3)], "ModeNum"))
    assert quad.shared(analyse).reached == 2, "it went on from both after it had been there"
    newer = mission("ArduCopter V4.5.4", CMD=cmd, MSG=Table(np.empty(0), {}), MODE=table([(0.0, 3)], "ModeNum"))
    assert newer.shared(analyse).reached == 0
    nowhere = {"ORGN": Table(np.empty(0), {}), "POS": Table(np.empty(0), {})}
    lost = mission("ArduCopter V3.2.1", CMD=cmd, MSG=Table(np.empty(0), {}), **nowhere)
    assert (lost.shared(analyse).reached, lost.shared(analyse).untold) == (0, 2)
    assert short_of(lost) == "at most 2 of 3 waypoints were reached"


@pytest.mark.parametrize("kind", ["leg_error", "leg_speed", "height_error", "airspeed_error", "level_power"])
def test_a_flight_that_completed_no_leg_says_so(kind: str) -> None:
    answer = value(kind, mission(MSG=table([(20.0, "Mission: 2 WP")], "Message")))
    assert isinstance(answer, Unavailable)
    assert "no leg" in answer.reason


def test_a_quadplane_takes_off_and_lands_upright() -> None:
    tables = flown()
    command = tables["CMD"].columns["CId"]
    command[command == 22], command[command == 21] = 84, 85
    flight = mission("ArduPlane V4.5.4", CMD=tables["CMD"])
    assert flight.shared(analyse).end == pytest.approx((0.0, 0.0), abs=1e-6)
    assert value("mission_success", flight) == 1.0


def test_a_transition_takes_as_long_as_it_says() -> None:
    rows = [(t, str(text)) for t, text in zip(flown()["MSG"].t, flown()["MSG"]["Message"], strict=True)]
    rows += [(11.0, "Transition started airspeed 0.9"), (20.5, "Transition done")]
    assert value("transition_time", mission(MSG=table(sorted(rows), "Message"))) == pytest.approx(9.5)
    assert isinstance(value("transition_time"), Unavailable)


def test_a_submarine_has_driven_its_mission_when_the_last_item_is_reached() -> None:
    rows = [
        (20.0, "Mission: 1 WP"),
        (60.0, "Reached command #1"),
        (60.0, "Mission: 2 WP"),
        (99.0, "Reached command #2"),
    ]
    cmd = table(
        [(0.0, 0, 16, 0.0, 0.0, *HOME, 0.0), *((0.0, k, 16, 0.0, 0.0, HOME[0] + 20 * k / METRES, HOME[1], -2.0 * k)
         for k in (1, 2))], "CNum", "CId", "Prm1", "Prm2", "Lat", "Lng", "Alt",
    )  # fmt: skip
    dive = mission("ArduSub V4.5.0", MSG=table(rows, "Message"), CMD=cmd, MODE=table([(8.0, 3)], "ModeNum"))
    done = dive.shared(analyse)
    assert done.drive is not None
    assert (done.drive.start_s, done.drive.end_s, done.completed) == (8.0, 99.0, True)
    assert value("mission_success", dive) == 1.0


def test_a_mission_that_a_vehicle_would_not_begin_failed() -> None:
    rows = [(10.0, "Mode change failed: AUTO requires position"), (20.0, "Mode change failed: AUTO requires position")]
    dive = mission("ArduSub V4.5.0", MSG=table(rows, "Message"), MODE=table([(0.0, 19)], "ModeNum"))
    assert value("mission_success", dive) == 0.0
    assert value("no_mission", dive) == 1.0


def test_a_circle_of_its_own_radius_is_no_circle_of_the_parameter() -> None:
    items = flown()["CMD"]
    own = np.where(items["CId"] == 18, 120.0, 0.0)
    flight = mission(CMD=Table(items.t, {**items.columns, "Prm3": own}))
    assert value("loiter_turns", flight) == 0.0
    assert value("legs_asked", flight, what="after_loiter") == 0.0, "the leg from it is on the final"
    assert value("legs_asked", flight, what="loiters") == pytest.approx(0.85 * 2 * 120.0 / 60.0)
    assert value("legs_asked", what="loiters") == 0.0, "the parameter's circles are counted as turns"
    assert value("mission_asked", flight, what="hold_time") == pytest.approx(2 * math.tau * 120.0 / 12.0)


def returning(*landing: tuple[int, float, float, float], **settings: float) -> Mission:
    """A flight whose mission returns after its third waypoint; (command, north, east, height) of the items behind."""
    items = [(22, 0.0, 0.0, 40.0), *((16, *place) for place in WAY[:3]), (20, 0.0, 0.0, 0.0), *landing]
    rows = [
        (0.0, k, c, 0.0, 0.0, HOME[0] + n / METRES, HOME[1] + e / EAST, up, 3)
        for k, (c, n, e, up) in enumerate([(16, 0.0, 0.0, 0.0), *items])
    ]
    flight = mission(CMD=table(rows, "CNum", "CId", "Prm1", "Prm2", "Lat", "Lng", "Alt", "Frame"))
    return replace(flight, settings={**flight.settings, **settings})


SEQUENCE = ((189, 0.0, 0.0, 0.0), (16, -600.0, 0.0, 60.0), (16, -300.0, 0.0, 30.0), (21, 0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("flight", "back"),
    [
        (returning(), 300.0),
        (returning(*SEQUENCE, RTL_AUTOLAND=0), 300.0),
        (returning(*SEQUENCE, RTL_AUTOLAND=1), 300.0 + 600.0 + 300.0 + 300.0),
        (returning(*SEQUENCE, RTL_AUTOLAND=2), math.hypot(600.0, 300.0) + 300.0 + 300.0),
    ],
    ids=["no landing", "circles over home", "lands from home", "lands at once"],
)
def test_the_way_back_is_what_the_return_flies(flight: Mission, back: float) -> None:
    assert value("way_asked", flight, what="out") == pytest.approx(900.0, abs=0.1)
    assert value("way_asked", flight, what="back") == pytest.approx(back, abs=0.1)


def test_a_mission_that_lands_has_no_way_back() -> None:
    assert value("way_asked", what="back") == 0.0
    legs = 900.0 + math.hypot(600.0, 300.0) + 600.0
    # It turns about, by 153 degrees, onto the final.
    assert value("way_asked", what="out") == pytest.approx(legs + math.pi * 60.0, abs=0.1)


def test_a_return_is_flown_at_its_height() -> None:
    assert value("way_asked", returning(RTL_ALTITUDE=100.0), what="climbs") == 100.0
    assert value("way_asked", returning(RTL_ALTITUDE=50.0), what="climbs") == 80.0


def test_home_has_a_height_where_the_log_tells_it() -> None:
    assert value("home_height") == 500.0
    nowhere = table([(1.0, 1, *HOME)], "Type", "Lat", "Lng")
    assert isinstance(value("home_height", mission(ORGN=nowhere)), Unavailable)


@pytest.mark.parametrize(("what", "expected"), [(0, 27.0), (1, 0.0)], ids=["airspeed", "ground speed"])
def test_an_airspeed_that_is_commanded_counts_and_a_ground_speed_does_not(what: int, expected: float) -> None:
    items = flown()["CMD"]
    added = {"CNum": 1.5, "CId": 178.0, "Prm1": float(what), "Prm2": 27.0, "Lat": 0.0, "Lng": 0.0, "Alt": 0.0}
    columns = {name: np.insert(items[name], 2, added[name]) for name in items.columns}
    columns["CNum"] = np.arange(len(columns["CNum"]), dtype=float)
    flight = mission(CMD=Table(np.zeros(len(columns["CNum"])), columns))
    assert value("mission_asked", flight, what="commanded_speed") == expected


def test_a_field_that_an_old_firmware_lacks_is_told_from_a_missing_message() -> None:
    old = Table(AT, {"Aspd": 19.0 + 0 * AT, "ThrDem": 45.0 + 0 * AT})
    lacking, absent = value("airspeed", mission(CTUN=old)), value("airspeed", mission(CTUN=Table(AT[:0], {})))
    assert isinstance(lacking, Unavailable)
    assert lacking.reason == "no CTUN with As in the log"
    assert "LOG_BITMASK" not in lacking.hint
    assert isinstance(absent, Unavailable)


@pytest.mark.parametrize(("forced", "reached"), [(0, 5), (1, 3)], ids=["by itself", "by force"])
def test_what_was_disarmed_by_force_did_not_go_on_from_its_waypoints(forced: int, reached: int) -> None:
    said = flown()["MSG"]
    silent = said.where(said.t < 80.0)
    arm = table([(5.0, 1, 0), (130.0, 0, forced)], "ArmState", "Forced")
    assert mission(MSG=silent, ARM=arm).shared(analyse).reached == reached


def test_a_return_that_goes_on_with_a_landing_ends_where_that_is() -> None:
    elsewhere = (*SEQUENCE[:-1], (21, 250.0, 100.0, 0.0))
    assert returning(*elsewhere, RTL_AUTOLAND=1).shared(analyse).end == pytest.approx((250.0, 100.0), abs=0.1)
    assert returning(*elsewhere, RTL_AUTOLAND=0).shared(analyse).end == pytest.approx((0.0, 0.0), abs=0.1)

"""Whether an ArduPilot run did what it set out to do: its mission, and what every run is judged by."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.heartbeat import told_to_fly
from care_core.ecosystems.ardupilot.measures.events import (
    UNRECORDED,
    crash_of,
    failed,
    fall_of,
    forced,
    is_over,
    never_asked,
    was_asked,
)
from care_core.ecosystems.ardupilot.measures.flown_mission import (
    NEEDS,
    SAID_AFTER_S,
    FlownMission,
    analyse,
    metres_between,
)
from care_core.ecosystems.ardupilot.measures.modes import flew_automatically, flight_of, is_armed, modes_in_force
from care_core.ecosystems.ardupilot.measures.requested import mission_held
from care_core.ecosystems.ardupilot.measures.route import landing_error
from care_core.ecosystems.ardupilot.measures.samples import lost_events, samples
from care_core.ecosystems.ardupilot.measures.shortfall import event_clause, landing_tolerance_m, short_of
from care_core.ecosystems.coverage import SUM, doubt
from care_core.ecosystems.measures import Args, Mission, extractor, has
from care_core.ecosystems.vehicles import flies
from care_core.ecosystems.vehicles.arming import CUT, GOES_ON, NEVER_ARMED
from care_core.ecosystems.vehicles.way import AIRBORNE_M
from care_core.geodesy import GRAVITY
from care_core.logs.base import Wanted
from care_core.numbers import Floats
from care_core.run import OutcomeCheck, Unavailable, Value, is_known

_TOOK_OFF, _LANDED = (16, 28), (18,)
"""EV records of the land detector."""
_DRIVES = frozenset(("rover",))
_GLIDES = frozenset(("plane", "quadplane"))
"""What lands where it finds room: its last height says little."""
_MOVED_M = 5.0
"""A receiver that stands still wanders by its accuracy, 2 to 3 m."""
_BARELY_M, _HOVERS_M = 0.5, 0.2
"""Rise below which a vehicle never left the ground: barometers drift by less in a flight's time; and where its own
detector says that it left it."""
_SINKS_M = 20.0
"""No runway is so steep, and no barometer drifts so far in a flight's time."""
_TOUCHED_S, _SWITCHED_OFF_S = 5.0, 0.05
"""Before the disarming, where the land detector found the ground: at most, and at least (disarming sets it as well)."""
_FALLS_S = 2.0
"""What is disarmed in the air falls by 20 m in this time."""
_IDLES, _RESTS_S, _FREE_FALL = 0.05, 1.0, GRAVITY / 2
"""Throttle that lifts nothing; time of it after which a fall shows, and metres in the square of that time."""
HEIGHTS: Wanted = {"POS": ("RelHomeAlt",), "CTUN": ("Alt", "BAlt", "BarAlt")}
"""Where heights are told: above home, else above some other ground."""


_REFUSED_MISSION = re.compile(r"Mode change (?:to AUTO )?failed: .*(?:AUTO|requires position)", re.IGNORECASE)
"""What a vehicle says that was told to begin its mission and would not (AP_Vehicle: notify_no_such_mode and the modes'
own)."""


_UNTOLD = Unavailable("the log does not say whether each waypoint was reached", "record MSG and POS from start to end")


def _nothing_to_judge(mission: Mission, flown: FlownMission) -> Unavailable | None:
    """Why a flight says nothing about a mission, None when it does."""
    held = mission.shared(mission_held)
    if isinstance(held, Unavailable):
        return held
    if held.lacks:
        known = f"the log holds {len(held.items)} of the {len(held.items) + held.lacks} items of the mission"
        return Unavailable(known, "judge a log that is whole")
    if not flown.waypoints:
        return Unavailable("the log names no waypoints", "record CMD", "CMD")
    if "MSG" not in mission.tables:
        return Unavailable("the log does not say which waypoints were reached", "record MSG", "MSG")
    return None


def plain_checks(mission: Mission, *, and_mission: bool = False) -> Iterator[OutcomeCheck]:
    """What a flight or drive is judged by that no limit belongs to; with its mission, where one was begun."""
    crash = crash_of(mission)
    crashed = bool(crash)
    yield OutcomeCheck("armed", 1.0, "the vehicle armed")
    kind = flight_of(mission).mode_kind
    leaves = flies(kind, flight_of(mission).log.facts.get("vehicle", ""))
    if leaves:
        yield OutcomeCheck(
            "took_off", _took_off(mission, crashed=crashed), "it left the ground", "it never left the ground"
        )
    elif and_mission and kind in _DRIVES:
        yield OutcomeCheck("moved", _moved(mission), "it moved")
    done: Value = 0.0
    if and_mission and any(mode.way == "mission" for mode in modes_in_force(mission)):
        done = _mission_done(mission)
        yield OutcomeCheck("mission_success", done, "every waypoint of the mission was reached", short_of(mission))
    silent: Value = lost_events(mission) or 1.0
    landed: Value = 1.0  # what does not fly comes to no harm by it
    how = event_clause(mission, "crash") or crash or fall_of(mission)
    no_crash = 0.0 if how else silent
    yield OutcomeCheck("no_crash", no_crash, "the autopilot reported no crash, and none shows", how)
    failsafe = event_clause(mission, "failsafe")
    yield OutcomeCheck("no_failsafe", 0.0 if failsafe else silent, "no failsafe acted", failsafe)
    if leaves:
        landed = Unavailable("it crashed") if crashed else _landed(mission)
        yield OutcomeCheck("landed", landed, "it was on the ground at the end", "it was disarmed above the ground")
    elif done == 1.0 and not mission.ended:
        return  # what stands on the ground when all is done comes to no harm by staying armed
    at_end: Value = float(landed == 1.0 or not forced(mission)) if mission.ended else _no_end(mission)
    if mission.ended and not flight_of(mission).arm_changes:
        at_end = UNRECORDED
    yield OutcomeCheck("disarmed", at_end, "it was disarmed, and not by force in flight", "it was disarmed by force")


def _mission_done(mission: Mission) -> Value:
    """1 where the vehicle says that its mission is complete or reached every waypoint of it, 0 where a crash or a
    failsafe ended it or it was disarmed on its way; what somebody broke off is no failure of the mission."""
    flown = mission.shared(analyse)
    if flown.completed:
        return 1.0
    unknown = _nothing_to_judge(mission, flown)
    if unknown is not None:
        return unknown
    if flown.reached >= len(flown.waypoints):
        return 1.0
    if failed(mission):
        return 0.0
    if flown.untold:
        return _UNTOLD
    if not mission.ended:
        return _no_end(mission)
    last = modes_in_force(mission)[-1]
    if last.way == "mission":
        return lost_events(mission) or 0.0
    return Unavailable(
        f"{short_of(mission)}, and the last mode was {last.name}", "judge a run that ends in its mission"
    )


def _no_end(mission: Mission) -> Unavailable:
    """Why the end of a run is not known that is not in the log."""
    return GOES_ON if mission.end_s < flight_of(mission).whole.end_s - SAID_AFTER_S else CUT


def _moved(mission: Mission) -> Value:
    """1 where its position changed by more than positions do that stand still; to stay is no failure."""
    position = mission.table("POS")
    if not has(position, "Lat", "Lng"):
        return Unavailable("the log holds no position", "record POS", "POS")
    far = metres_between(position["Lat"], position["Lng"])
    return 1.0 if far > _MOVED_M else Unavailable(f"it stayed within {far:.1f} m")


def _took_off(mission: Mission, *, crashed: bool) -> Value:
    heights = _heights(mission)
    flight = flight_of(mission)
    lifted = not flight.is_copter or flight.throttle is None or bool(flight.airborne)  # no height without thrust
    rose = len(heights) > 0 and bool(heights.max() > AIRBORNE_M)
    flew = bool(flight.leans_as_told) or (lifted and (rose or _began_aloft(mission) or _flew_by_itself(mission)))
    if flew or crashed:
        return float(flew)
    least_m = _BARELY_M if lifted else _HOVERS_M if _flew_by_itself(mission) else np.inf
    if len(heights) and heights.max() > least_m:
        return Unavailable(f"it rose no higher than {heights.max():.1f} m: too little to tell a flight by")
    return Unavailable("it never left the ground" if len(heights) else "the log holds no height")


def _began_aloft(mission: Mission) -> bool:
    """Whether it flew as the log begins: a plane that moves as planes fly and sinks far below that, since an autopilot
    that started in the air takes its height there for that of the ground; or what flies so far above its home, whose
    arming is not in the log, since home is set where it is armed."""
    flight, heights = flight_of(mission), _heights(mission)
    if not any(start < mission.end_s and end > mission.start_s for start, end in flight.airborne):
        return False
    above = mission.table("POS")
    is_above = not flight.arm_changes and has(above, "RelHomeAlt") and float(above["RelHomeAlt"].min()) > _SINKS_M
    return is_above or (flight.is_winged and len(heights) > 0 and float(heights[0] - heights.min()) > _SINKS_M)


def _landed(mission: Mission) -> Value:
    if not is_known(_took_off(mission, crashed=False)):
        return _took_off(mission, crashed=False)
    if not mission.ended:
        return _no_end(mission)
    heights = _heights(mission)
    if _touched_down(mission):
        return 1.0
    if len(heights) and (unseen := _unseen_end(mission)) is not None:
        return unseen
    low = bool(heights[-1] <= AIRBORNE_M) if len(heights) else _detected(mission, _LANDED)
    low = low or flight_of(mission).stands_at_end or _is_low_by_barometer(mission)
    if not low and flight_of(mission).kind in _GLIDES:
        return Unavailable(f"it was disarmed {heights[-1]:.0f} m above home" if len(heights) else "nothing says so")
    return float(low or _stays_there(mission) or _rests(mission))


def _is_low_by_barometer(mission: Mission) -> bool:
    """Whether the barometer of a copter has it on the ground at the end, as where it was armed: an estimate that ran
    away from it lifts nothing."""
    flight = flight_of(mission)
    if not flight.is_copter or flight.barometer is None:
        return False
    t, height = flight.barometer
    last = height[(t > mission.end_s - _RESTS_S) & (t <= mission.end_s)]
    return len(last) > 2 and float(np.max(np.abs(last))) < AIRBORNE_M


def _stays_there(mission: Mission) -> bool:
    """Whether it keeps its height once its motors stop: it stands on ground that is higher than its home. A height that
    is only repeated tells nothing."""
    known = flight_of(mission).height
    if known is None:
        return False
    t, height = known
    after = (t >= mission.end_s) & (t <= mission.end_s + _FALLS_S)
    seen = t[after]
    return len(seen) > 2 and float(np.ptp(seen)) > _FALLS_S / 2 and 0.0 < float(np.ptp(height[after])) < AIRBORNE_M


def _rests(mission: Mission) -> bool:
    """Whether a copter whose motors lift nothing has stopped falling before it is disarmed: it stands on the ground,
    whatever its barometer says of that height."""
    flight = flight_of(mission)
    if not flight.is_copter or flight.kind == "heli" or flight.throttle is None or flight.height is None:
        return False
    driven_t, driven = flight.throttle
    lifting = driven_t[(driven > _IDLES) & (driven_t >= mission.start_s) & (driven_t <= mission.end_s)]
    since_s = float(lifting[-1]) if len(lifting) else mission.start_s
    t, height = flight.height
    idle = height[(t >= since_s) & (t <= mission.end_s)]
    lasted = mission.end_s - since_s
    if lasted < _RESTS_S or len(idle) < 3 or float(np.ptp(idle)) == 0.0:  # a height that is only repeated tells nothing
        return False
    return float(idle[0] - idle[-1]) < _FREE_FALL * lasted**2 / 2


def _unseen_end(mission: Mission) -> Unavailable | None:
    """Why the last height that is known is not that of the end."""
    channel = next((name for name in HEIGHTS if has(mission.table(name), *HEIGHTS[name][:1])), "")
    return doubt(samples(mission, channel, (), (), SUM, [mission.end_s])) if channel else None


def _heights(mission: Mission) -> Floats:
    """Heights above where it was armed, while it was, shape (n,); none where the log does not tell any."""
    known = flight_of(mission).height
    if known is None:
        return np.empty(0)
    t, height = known
    return np.asarray(height[(t >= mission.start_s) & (t <= mission.end_s) & np.isfinite(height)], dtype=np.float64)


def _touched_down(mission: Mission) -> bool:
    """Whether the land detector found the ground just before it was disarmed, whatever a barometer that drifted says:
    disarming itself sets the detector as well, so that record does not count."""
    said = np.array(flight_of(mission).events(*_LANDED))
    return bool(((said > mission.end_s - _TOUCHED_S) & (said < mission.end_s - _SWITCHED_OFF_S)).any())


def _detected(mission: Mission, events: tuple[int, ...]) -> bool:
    """Whether the land detector said so."""
    return any(mission.start_s <= t <= mission.end_s for t in flight_of(mission).events(*events))


def _flew_by_itself(mission: Mission) -> bool:
    """Whether its own detector said that it left the ground, by an event or in its heartbeats."""
    beats = told_to_fly(flight_of(mission))
    return _detected(mission, _TOOK_OFF) or any(a <= mission.end_s and b >= mission.start_s for a, b in beats)


@extractor("mission_success", needs=NEEDS, unit="")
def mission_success(mission: Mission, args: Args) -> Value:
    """1 when every waypoint was reached, the vehicle landed where the mission ends (within `tolerance_m` of it; a rover
    says that its mission is complete) and disarmed by itself, with no crash and no failsafe; else 0. A refused arming
    is 0, where somebody tried to arm."""
    if not is_armed(mission):
        return 0.0 if was_asked(mission) else never_asked(mission)
    if not flew_automatically(mission):
        return 0.0 if mission_refused(mission) else Unavailable("no mission was flown")
    if failed(mission):
        return 0.0
    return _mission_flown(mission) if is_over(mission) else _no_end(mission)


def mission_refused(mission: Mission) -> bool:
    """Whether the vehicle would not begin its mission to the end, though it was armed and told to."""
    told = flight_of(mission).messages_between(mission.start_s, mission.end_s)
    return any(_REFUSED_MISSION.match(text) for _, text in told)


@extractor("no_mission", needs=NEEDS, unit="")
def no_mission(mission: Mission, args: Args) -> Value:
    """1 when the vehicle was armed, told to begin its mission, and never did, else 0."""
    if not is_armed(mission):
        return NEVER_ARMED
    return float(not flew_automatically(mission) and mission_refused(mission))


def _mission_flown(mission: Mission) -> Value:
    """1 when every waypoint was reached and the vehicle landed where the mission ends, or said so, else 0."""
    flown = mission.shared(analyse)
    unknown = _nothing_to_judge(mission, flown)
    if unknown is not None:
        return unknown
    if flown.reached < len(flown.waypoints):
        return (_UNTOLD if flown.untold else None) or lost_events(mission) or 0.0
    if flown.drive is not None:
        return float(flown.completed)
    if flown.end is None:
        return 1.0
    off_m = landing_error(mission, {})
    if not is_known(off_m):
        return off_m
    return float(off_m <= landing_tolerance_m(mission))

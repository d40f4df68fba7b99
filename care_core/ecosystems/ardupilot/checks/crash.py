"""A crash, and a tip-over at take-off: what happened to the vehicle, whatever brought it about."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.airborne import ACRO, OFF_GROUND_M
from care_core.ecosystems.ardupilot.checks.takeoff import wrong_layout
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import CAME_DOWN, LEANED, STEERED, STRUCK, UNDRIVEN, Finding
from care_core.ecosystems.spans import runs
from care_core.ecosystems.vehicles.errors import CRASH_CHECK
from care_core.logs.base import Wanted
from care_core.numbers import Floats

READS: Wanted = {"RCIN": ("C3",)}

_FEWEST = 5
LIMITS = Limits()
_LOW_M = LIMITS.add("height of a tip-over", 1.5, "m", "a choice: lower than a person's chest")
_LOW_BY_BARO_M = LIMITS.add("the same by the barometer", 3.0, "m", "propellers blow at it: 1 to 2 m off")
_UPRIGHT_DEG = LIMITS.add("tilt of what stands", 45.0, "deg", "a choice: steeper than any slope to start on")
_STANDS_S = LIMITS.add("time that it stands", 1.0, "s", "a choice: what falls is down sooner")
_TAKEOFF_S = LIMITS.add("tip-over after the first throttle", 15.0, "s", "a choice: a take-off takes no longer")
_FIRST_THROTTLE = LIMITS.add("first throttle", 0.15, "", "a choice: MOT_SPIN_MIN as shipped")
_IDLES = LIMITS.add("throttle that is cut", 0.05, "", "a choice: motors idle below it")
_STICK_LOW = LIMITS.add("throttle stick at its bottom", 1150.0, "us", "a choice: sticks end between 1000 and 1100")
_STICK_LEAST = LIMITS.add("pulse of a stick", 800.0, "us", "receivers send 800 to 2200; less is no signal")
_ANSWERS_S = LIMITS.add("time in which a mode acts on the throttle", 0.5, "s", "a choice: motors answer sooner")
_FALL_S = LIMITS.add("fall that may have begun in another mode", 2.0, "s", "free fall: 20 m")
_SINKS_M = LIMITS.add("descent in the second before a mode that is a fall", 0.5, "m", "a choice: a landing is as fast")
_LANDS_S = LIMITS.add("time in which it came down to land", 10.0, "s", "a choice: 5 m at LAND_SPEED as shipped")
_LANDS_MS = LIMITS.add("descent of a landing", 2.0, "m/s", "a choice: four times LAND_SPEED as shipped")
_LANDS_DEG = LIMITS.add("lean of a landing", 20.0, "deg", "a choice: wind and a pilot lean it by less")
_TOUCHES_S = LIMITS.add("time in which it goes over as it touches the ground", 0.7, "s", "a choice: a fall over a leg")
_TIPPED_P = LIMITS.add("probability of a tip-over's usual reasons", 0.5, "", "a choice: order, direction or propellers")
_LEANS_DEG = LIMITS.add("lean that is asked for on the ground", 12.0, "deg", "a choice: more than a slope to start on")
_LEANS_S = LIMITS.add("time in which that tips it over", 2.0, "s", "a choice: it goes over its gear in a second or two")
_LEANED_P = LIMITS.add("probability that this tipped it over", 0.85, "", "a choice: a foot that caught, beside it")
_BY_STICKS_P = LIMITS.add("probability that the sticks turned it over", 0.5, "", "a choice: in acro they do, or a part")
_CRASHED_P = LIMITS.add("probability that a part broke", 0.1, "", "a choice: a crash says that it failed, hardly why")
_STEERED_P = LIMITS.add("probability that its stick brought it down", 0.9, "", "a choice: it may have been falling")
_CAUGHT_P = LIMITS.add("probability that it lies on what brought it down", 0.9, "", "nothing else holds it up there")
_STRUCK_P = LIMITS.add("probability that a blow brought it down", 0.5, "", "a choice: a part that breaks strikes, too")
_STRANDED_P = LIMITS.add(
    "probability of what could not rise", 0.0, "", "it says that the run failed, and nothing of why"
)


def find(flight: Flight) -> Iterator[Finding]:
    """One finding: tipped over before it had flown, crashed, or came down."""
    told = min((t for t, code in flight.errors(CRASH_CHECK) if code > 0), default=None)
    said = min((t for t, text in flight.messages if text.startswith(("Crash: ", "Crash!"))), default=None)
    lost, impact = flight.lost_control_s, flight.impact_s
    begin = min((t for t in (told, said, lost, impact) if t is not None), default=None)
    if begin is None:
        yield from _stranded(flight)
        yield from _survived(flight)
    elif _tipped(flight, lost if lost is not None else begin):
        if wrong_layout(flight) is not None or flight.stands_still(begin):
            return  # the layout says why; or its attitude alone went over
        yield _tipped_over(flight, begin, told)
    elif told is not None or said is not None or impact is not None:
        first = min(t for t in (told, said, impact, flight.struck_s) if t is not None)
        is_said = told is not None or said is not None
        over = lost is None and not is_said and first == flight.turned_over_s
        undriven = not over and _undriven(flight, first)
        landing = not over and not undriven and _at_landing(flight, first)
        steered = "" if undriven or landing else _steered(flight, first)
        by_sticks = over and int(flight.modes_at(np.array([first]))[0]) in ACRO
        shown = (
            "the firmware says: crash" if is_said else "control was lost, and it came down" if lost is not None else "",
            "" if flight.ending_hit is None else flight.ending_hit.said,
            steered,
            "it went over with its motors turning, and lay on its back until it was disarmed" if over else "",
            "the sticks tell how fast it turns in this mode" if by_sticks else "",
            "no throttle was given since it was armed: does it estimate its attitude rightly?" if undriven else "",
            _how_it_landed(flight, first) if landing else "",
            "a blow came before control was lost" if flight.blow_s is not None and not landing else "",
            "it turned over and did not fall: it lies on what it hit" if flight.is_caught else "",
        )
        title = UNDRIVEN if undriven else "it turned over" if over else _what(flight, steered, landing=landing)
        yield Finding(
            kind="crash",
            title=title,
            onset_s=first,
            end_s=first,
            severity="critical",
            evidence="; ".join(filter(None, shown)),
            source="ERR 12, MSG, ATT, IMU, height",
            suspect="operation" if steered or by_sticks or landing else "world" if title == STRUCK else "hardware",
            probability=_of(flight, title, by_sticks=by_sticks or landing),
        )


def _tipped_over(flight: Flight, at: float, told: float | None) -> Finding:
    """A copter that went over before it had flown: as it was told to lean while it stood, or for the usual reasons of a
    take-off."""
    asked_deg = _asked_to_lean(flight, at)
    low = f"never above {_LOW_M:g} m before control was lost"
    why = (
        f"it was told to lean by {asked_deg:.0f} degrees while it stood"
        if asked_deg is not None
        else "wrong motor order, turning direction or propellers show like this"
    )
    return Finding(
        kind="takeoff",
        title="it tipped over at take-off" if asked_deg is None else LEANED,
        onset_s=at,
        end_s=max(told or at, at),
        severity="critical",
        evidence=f"{low}; {why}",
        source="ATT, height, ERR 12; 30 degrees: ArduCopter's crash check",
        probability=_TIPPED_P if asked_deg is None else _LEANED_P,
        suspect="operation",
    )


def _asked_to_lean(flight: Flight, at: float) -> float | None:
    """How far a copter was told to lean as it began to tip over, degrees, where that is more than a start on a slope
    takes and it went over that way; None otherwise."""
    table = flight.one("ATT", "Roll", "Pitch", "DesRoll", "DesPitch")
    if table is None:
        return None
    told = np.hypot(table["DesRoll"], table["DesPitch"])
    before = (table.t > at - _LEANS_S) & (table.t <= at)
    ways = table["Roll"] * table["DesRoll"] + table["Pitch"] * table["DesPitch"]
    if before.sum() < _FEWEST or ways[before][-1] <= 0:
        return None
    asked_deg = float(np.median(told[before]))
    return asked_deg if asked_deg > _LEANS_DEG else None


def _of(flight: Flight, title: str, *, by_sticks: bool) -> float:
    """How surely what is told of a crash is why it came down."""
    if title == STEERED:
        return _STEERED_P
    if title == STRUCK:
        return _CAUGHT_P if flight.is_caught else _STRUCK_P
    return _BY_STICKS_P if by_sticks else _CRASHED_P


def _what(flight: Flight, steered: str, *, landing: bool) -> str:
    if landing:
        return "it turned over at landing"
    if steered:
        return STEERED
    if flight.struck_s is not None:
        return STRUCK
    hit = flight.ending_hit
    return "it crashed" if hit is None else f"it hit {hit.what} at {hit.speed_ms:.1f} m/s"


def _at_landing(flight: Flight, at: float) -> bool:
    """Whether a copter that had flown was down as it turned over: with its throttle cut as it struck the ground, or
    level and slow until it touched it."""
    driven, known, lost = flight.throttle, flight.height, flight.lost_control_s
    if driven is None or known is None or lost is None or not flight.is_copter or not flight.airborne:
        return False
    if not flight.airborne[0][0] < at or flight.ending_hit is not None:
        return False
    is_low = float(np.interp(at, *known)) < OFF_GROUND_M
    return is_low and (float(np.interp(at, *driven)) < _IDLES or _touched_level(flight, min(at, lost)))


def _how_it_landed(flight: Flight, at: float) -> str:
    assert flight.throttle is not None
    is_cut = float(np.interp(at, *flight.throttle)) < _IDLES
    how = "its throttle was down" if is_cut else "it was level and slow"
    return f"{how} as it touched the ground"


def _touched_level(flight: Flight, at: float) -> bool:
    """Whether it came down from above a person's chest as slowly as one lands, by its barometer, and leaned little
    until it touched the ground."""
    if flight.barometer is None or flight.tilt is None:
        return False
    t, height = flight.barometer
    last = (t > at - _LANDS_S) & (t <= at)
    if not last.any() or float(np.max(height[last])) < _LOW_M or float(np.interp(at, *flight.barometer)) > _LOW_M:
        return False
    sank = float(np.interp(at - 1.0, *flight.barometer) - np.interp(at, *flight.barometer))
    leant = flight.tilt[1][(flight.tilt[0] > at - 2 * _LEANS_S) & (flight.tilt[0] <= at - _TOUCHES_S)]
    return sank < _LANDS_MS and len(leant) > 2 and float(np.max(leant)) < _LANDS_DEG


def _stranded(flight: Flight) -> Iterator[Finding]:
    if flight.stranded is not None:
        start, end = flight.stranded
        yield Finding(
            kind="crash",
            title=CAME_DOWN,
            onset_s=start,
            end_s=end,
            severity="critical",
            evidence=(
                f"on the ground for {end - start:.0f} s with the motors up, below the height that it is told to reach"
            ),
            source="CTUN",
            probability=_STRANDED_P,
        )


def _survived(flight: Flight) -> Iterator[Finding]:
    if (hit := flight.survived) is not None:
        is_world = flight.is_copter
        yield Finding(
            kind="crash",
            title=STRUCK if is_world else f"it hit {hit.what} at {hit.speed_ms:.0f} m/s and flew on",
            onset_s=hit.time_s,
            end_s=hit.time_s,
            severity="critical",
            evidence=hit.said,
            source="IMU, VIBE.Clip, ATT, GPS.Spd, height",
            suspect="world" if is_world else "hardware",
            probability=_STRUCK_P if is_world else _CRASHED_P,
        )


def _tipped(flight: Flight, at: float) -> bool:
    """Whether it had not been higher than a person's knee, within seconds of its first throttle."""
    span = next(((a, b) for a, b in flight.armed if a <= at <= b + 3), None)
    if span is None or not flight.is_copter:
        return False
    known, driven = flight.height, flight.throttle
    span = max(span[0], _last_stood(flight, at) or span[0]), span[1]
    by_estimate, by_barometer = _highest(known, span[0], at), _highest(flight.barometer, span[0], at)
    rose = by_estimate > _LOW_M and (flight.barometer is None or by_barometer > _LOW_M)
    if rose or by_barometer > _LOW_BY_BARO_M:
        return False
    if driven is None:
        return known is not None
    t, throttle = driven
    up = t[(t >= span[0]) & (t <= at) & (throttle > _FIRST_THROTTLE)]
    return bool(len(up)) and at - float(up[0]) < _TAKEOFF_S


def _highest(known: tuple[Floats, Floats] | None, since_s: float, at: float) -> float:
    """How high it was in that time, m; 0 where nothing tells."""
    if known is None:
        return 0.0
    t, height = known
    return float(np.max(height[(t >= since_s) & (t <= at)], initial=0.0))


def _last_stood(flight: Flight, at: float) -> float | None:
    """Until when it stood upright with its throttle cut before that was last up; None where it did not, or the log does
    not tell. What falls stands nowhere."""
    if flight.height is None or flight.throttle is None:
        return None
    t, throttle = flight.throttle
    up = t[(t < at) & (throttle > _FIRST_THROTTLE)]
    if not len(up):
        return None
    low = np.interp(t, *flight.height) < OFF_GROUND_M
    if flight.barometer is not None:
        by_barometer = np.interp(t, *flight.barometer)
        low = (low & (by_barometer < _LOW_BY_BARO_M)) | (np.abs(by_barometer) < OFF_GROUND_M)
    stood = low & (t < up[-1]) & (throttle < _FIRST_THROTTLE)
    if flight.tilt is not None:
        stood &= np.interp(t, *flight.tilt) < _UPRIGHT_DEG
    return max((end for start, end in runs(t, stood) if end - start >= _STANDS_S), default=None)


def _undriven(flight: Flight, at: float) -> bool:
    """Whether the firmware itself found a crash of a copter that stood on the ground with its motors at rest: it then
    believes an attitude that it does not have."""
    if not flight.is_copter or flight.throttle is None or flight.hit is not None:
        return False
    span = next((one for one in flight.armed if one[0] <= at <= one[1] + 3.0), None)
    if span is None or any(start < at and end > span[0] for start, end in flight.airborne):
        return False
    t, throttle = flight.throttle
    given = throttle[(t >= span[0]) & (t <= at)]
    return len(given) > _FEWEST and float(np.max(given)) < _FIRST_THROTTLE


def _steered(flight: Flight, at: float) -> str:
    """What shows that it went down as told: the attitude was followed, and the pilot's throttle stick was at its
    bottom."""
    mode = flight.mode_at(at - _ANSWERS_S)
    by_stick = mode is not None and mode.way in ("manual", "hold") and not _fell_before(flight, mode.start_s, at)
    if not by_stick or (flight.lost_control_s is not None and flight.lost_control_s < at - 1.0):
        return ""
    sticks = flight.one("RCIN", "C3")
    if sticks is None:
        return ""
    stick = sticks["C3"][(sticks.t > at - 8.0) & (sticks.t <= at - 1.0)]
    low = len(stick) > 2 and float(np.max(stick)) < _STICK_LOW and float(np.min(stick)) > _STICK_LEAST
    return "the throttle stick was at its bottom and the attitude followed its demand" if low else ""


def _fell_before(flight: Flight, since_s: float, at: float) -> bool:
    """Whether it came down already as the mode began in which it hit the ground: then its stick did not bring it
    down."""
    if at - since_s > _FALL_S:
        return False
    if flight.height is None:
        return True
    return float(np.interp(since_s - 1.0, *flight.height) - np.interp(since_s, *flight.height)) > _SINKS_M


CHECK = Check("crash", "a crash, or a tip-over at take-off", READS, LIMITS, find)

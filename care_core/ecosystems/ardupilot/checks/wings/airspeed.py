"""An airspeed sensor that the firmware gave up, and a plane that flew too slow.

A pitot tube that is blocked repeats itself, which liveness tells, or follows the height, until the firmware finds that
it is at odds with the estimate and flies on without it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.statistics import lasting, smooth
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.spans import Span, during
from care_core.logs.base import Table, Wanted
from care_core.numbers import Bools, Floats
from care_core.text import log_time

READS: Wanted = {
    "ARSP": ("Airspeed", "U", "H"),
    "CTUN": ("As",),
    "GPS": ("Spd",),
    "ATT": ("Pitch",),
}

LIMITS = Limits()
_FLIES_MS = LIMITS.add("speed over ground of flight", 8.0, "m/s", "a choice: no plane taxies so fast")
_NOTHING_MS = LIMITS.add("airspeed that is none", 1.5, "m/s", "a choice: no plane flies so slow, whatever the wind")
_NOTHING_S = LIMITS.add("shortest time of none in the air", 10.0, "s", "a choice: a blocked tube clears in less")
_GIVEN_UP_S = LIMITS.add(
    "shortest time for which the firmware gave it up", 3.0, "s", "a choice: a plane flies on as it did for less"
)
_SLOW = LIMITS.add(
    "airspeed, as a share of AIRSPEED_MIN, below which a plane stalls",
    0.85,
    "",
    "a choice: near the stall, which AIRSPEED_MIN is to be 25% above (ArduPilot, Airspeed Parameters Setup)",
)
_SLOW_S = LIMITS.add("shortest time so slow", 2.0, "s", "a choice: a gust is over sooner")
_SINKS_MS = LIMITS.add("sink of a stall", 3.0, "m/s", "a choice: TECS_SINK_MIN is 2 as shipped")
_FAILED_P = LIMITS.add("probability of a sensor that was given up", 0.9, "", "the firmware's own word")
LOST_P = LIMITS.add(
    "probability that it costs the mission", 0.3, "", "3 of 10 simulated flights: what is estimated in its place is off"
)
_STALLS_P = LIMITS.add("probability of a part, in a stall", 0.3, "", "a choice: speeds and gains make it stall as well")
_HIGH_M = 15.0
SENSOR_FAILED, SENSOR_SILENT = "the airspeed sensor failed", "the airspeed sensor reads nothing in the air"
_FAILS = re.compile(r"Airspeed sensor \d+ failure\. Disabling")


def find(flight: Flight) -> Iterator[Finding]:
    """The sensor first: a plane that believes a false airspeed flies too slow by it."""
    if not flight.is_winged:
        return
    moved = flight.one("GPS", "Spd")
    sensor = flight.one("ARSP", "Airspeed")
    is_frozen = bool(flight.repeats("ARSP"))  # told as such
    if not is_frozen and (span := _reads_nothing(flight, moved)) is not None:
        yield _silent(flight, span)
    elif sensor is None:
        yield from _said_to_fail(flight)
    elif moved is not None and flight.setting("ARSPD_USE") != 0 and not is_frozen:
        yield from _given_up(flight, sensor, moved)
    if flight.kind == "plane":
        yield from _stall(flight)


def _flies(flight: Flight, moved: Table, t: Floats) -> Bools:
    """Which of these times it flies at, faster over ground than any plane taxies."""
    return np.asarray((np.interp(t, moved.t, moved["Spd"]) > _FLIES_MS) & during(flight.flown, t))


def _reads_nothing(flight: Flight, moved: Table | None) -> Span | None:
    """From when to when a sensor that is fitted and used reads next to nothing while the plane flies; None where it
    never does. What is none is estimated from the speed over ground and the wind, and is never so low."""
    read = flight.one("ARSP", "Airspeed") or flight.one("CTUN", "As")
    if read is None or moved is None or not flight.setting("ARSPD_TYPE") or not flight.setting("ARSPD_USE"):
        return None
    t, airspeed = read.t, read["Airspeed" if "Airspeed" in read.columns else "As"]
    flies = _flies(flight, moved, t)
    spans = lasting(t, flies & (airspeed < _NOTHING_MS), _NOTHING_S)
    return (spans[0][0], spans[-1][1]) if spans and not (airspeed[flies] >= _FLIES_MS).any() else None


def _silent(flight: Flight, span: Span) -> Finding:
    return Finding(
        kind="airspeed",
        title=SENSOR_SILENT,
        onset_s=span[0],
        end_s=span[1],
        severity="warning",
        evidence=(
            f"below {_NOTHING_MS:g} m/s in the air, at more than {_FLIES_MS:g} m/s over ground, with "
            f"ARSPD_TYPE={flight.setting('ARSPD_TYPE'):g} and ARSPD_USE={flight.setting('ARSPD_USE'):g}"
        ),
        source="ARSP.Airspeed or VFR_HUD.airspeed against GPS.Spd",
        probability=_FAILED_P,
        mission_lost=LOST_P,
    )


def _given_up(flight: Flight, sensor: Table, moved: Table) -> Iterator[Finding]:
    t, read = sensor.t, sensor["Airspeed"]
    flies = _flies(flight, moved, t)
    if flies.sum() < 10 or not (read[flies] > 0).any():
        return
    out = np.zeros(len(t), dtype=bool)
    for column in ("U", "H"):
        if column in sensor.columns and (sensor[column] > 0).any():
            out |= sensor[column] == 0
    spans = lasting(t, flies & out, _GIVEN_UP_S)
    if not spans:
        return
    start, end = spans[0][0], spans[-1][1]
    ground = float(np.mean(np.interp(t, moved.t, moved["Spd"])[during(spans, t)]))
    yield Finding(
        kind="airspeed",
        title=SENSOR_FAILED,
        onset_s=start,
        end_s=end,
        severity="warning",
        evidence=(
            f"the firmware took it out of use at {log_time(start, 0)}, where it read "
            f"{float(np.interp(start, t, read)):.1f} m/s at {ground:.0f} m/s over ground"
        ),
        source="ARSP.Airspeed, U, H against GPS.Spd",
        probability=_FAILED_P,
        mission_lost=LOST_P,
    )


def _said_to_fail(flight: Flight) -> Iterator[Finding]:
    """The firmware's word alone, where the log does not hold what the sensor read, as telemetry does not."""
    said = [(t, text) for t, text in flight.messages if _FAILS.match(text) and during(flight.flown, np.array([t]))[0]]
    if said:
        often = f" ({len(said)} times)" if len(said) > 1 else ""
        yield Finding(
            kind="airspeed",
            title=SENSOR_FAILED,
            onset_s=said[0][0],
            end_s=said[-1][0],
            severity="warning",
            evidence=f"the firmware says: {said[0][1]}{often}",
            source="MSG; AP_Airspeed_Health.cpp",
            probability=_FAILED_P,
            mission_lost=LOST_P,
        )


def _stall(flight: Flight) -> Iterator[Finding]:
    flown, height, least = flight.one("CTUN", "As"), flight.height, flight.setting("AIRSPEED_MIN", "ARSPD_FBW_MIN")
    if flown is None or height is None or not least:
        return
    t = flown.t
    level = np.interp(t, *height)
    sinks = -np.gradient(smooth(t, level, 1.0), t) if len(t) > 2 else np.zeros(len(t))
    high = (level > _HIGH_M) & during(flight.flown, t)
    spans = lasting(t, high & (flown["As"] < _SLOW * least) & (sinks > _SINKS_MS), _SLOW_S)
    if not spans:
        return
    held = during(spans, t)
    yield Finding(
        kind="attitude",
        title="the plane stalled",
        onset_s=spans[0][0],
        end_s=spans[-1][1],
        severity="critical" if flight.impact_s is not None else "warning",
        evidence=(
            f"airspeed down to {float(np.min(flown['As'][held])):.1f} m/s (AIRSPEED_MIN {least:g}), "
            f"sinking at {float(np.max(sinks[held])):.1f} m/s"
        ),
        source="CTUN.As, the height",
        probability=_STALLS_P,
    )


CHECK = Check("airspeed", "an airspeed sensor that failed, a stall", READS, LIMITS, find)

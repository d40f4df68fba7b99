"""The model of one ArduPilot flight or drive, for checks, timeline and measures alike.

It is built in layers, one module each: what the log says (`recorded`), when it was armed (`armed`), when it was in the
air and lost (`airborne`), and here what of it can be judged, with its batteries.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cached_property

import numpy as np

from care_core.ecosystems.ardupilot import airborne, armed, recorded, sources
from care_core.ecosystems.ardupilot.airborne import FOLLOWED_DEG, OFF_GROUND_M, Airborne
from care_core.ecosystems.ardupilot.battery import Battery
from care_core.ecosystems.ardupilot.instances import FIX
from care_core.ecosystems.ardupilot.one_run import OneRun, windows_of
from care_core.ecosystems.base import RunModel
from care_core.ecosystems.liveness import Frozen
from care_core.ecosystems.spans import Span, during, runs
from care_core.ecosystems.vehicles.errors import BATTERY_FAILSAFE
from care_core.logs.base import Wanted, merge_needs
from care_core.numbers import Bools, Floats

READS: Wanted = merge_needs((
    recorded.READS,
    armed.READS,
    airborne.READS,
    {"GPS": ("Spd",), "VIBE": ("Clip",), "BAT": ("Volt", "Curr"), "RCOU": ("C1",)},
))  # fmt: skip
"""What the model is worked out from, by today's names."""

STANDS_MS = 0.5
_LEANS_DEG, _HELD_S = 15.0, 10.0
"""A lean of 15 degrees speeds a copter up by 2.6 m/s^2, to 26 m/s in 10 s, and ANGLE_MAX allows 30 or 45 as shipped. A
gale holds such a lean still as well, but strikes nothing."""
_STILL_MS, _LEANS_FAR_DEG, _STILL_S, _LEANS_ON_DEG = 0.15, 20.0, 5.0, 5.0
"""Nor does a gale of 15 m/s, in which a lean so far stands still, let a copter rest so: its gusts move it. Whatever it
was told to lean: one that a motor fails falls. It began to lean on what holds it from the last of these on."""
_STANDS_S, _WALKS_MS, _IDLES = 5.0, 1.5, 0.1
"""What stood for so long, no faster than a receiver's speed wanders, with less throttle than taxiing takes."""
_GROWN_MS, _UPRIGHT_DEG, _GROWN_DEG, _GROWN_S, _GROWS_S = 0.3, 5.0, 10.0, 3.0, 5.0
"""A lean that grows so far within so long moves what is free, by 1.7 m/s^2, and a gust that asked for it would too."""
_LIFTS = 0.2
"""Throttle that lifts a light copter, or holds it in a descent; on the ground it idles at half of it."""
BY_STICK = (0, 1)
"""Modes of a copter in which the throttle is the pilot's, and its motors idle where it is closed: Stabilize, Acro."""
_REFUSED_S = 30.0
"""The firmware repeats its complaints at least as often (AP_Arming: every 30 s)."""


def _lasting(t: Floats, held: Bools, least_s: float) -> tuple[Span, ...]:
    """Spans of at least so many seconds in which something is so."""
    return tuple((a, b) for a, b in runs(t, held, gap_s=1.0) if b - a >= least_s)


def _grown(t: Floats, lean: Floats, stands: Bools) -> Iterator[Span]:
    """Spans in which a lean grew from upright where a vehicle stands, and stayed, from when it was last upright."""
    for start, end in _lasting(t, stands & (lean > _GROWN_DEG), _GROWN_S):
        upright = t[stands & (lean < _UPRIGHT_DEG) & (t < start) & (t > start - _GROWS_S)]
        if len(upright):
            yield float(upright[-1]), end


class Flight(Airborne):
    """One log. Times are seconds since its start; spans are (start, end). What it does not hold is None or empty."""

    reads = READS

    @cached_property
    def runs(self) -> tuple[Flight, ...]:
        """Each run of the log as a flight of its own; this one where it holds no two."""
        read = {one.time_s: one.time_s if math.isnan(one.read_s) else one.read_s for one in self.arm_changes}
        armed = self.recorded_armed
        windows = windows_of([(read.get(start, start), end) for start, end in armed], self.end_s)
        if len(windows) == 1:
            return (self,)
        return tuple(Flight(OneRun(self, own, start)) for own, (start, _) in zip(windows, armed, strict=True))

    @cached_property
    def whole(self) -> Flight:
        """The log of which this is one run; itself where it holds no two."""
        of = self.log.whole if isinstance(self.log, OneRun) else self
        return of if isinstance(of, Flight) else self

    def run_at(self, t: float) -> Flight:
        """The run to which a time belongs."""
        return next((run for run in self.runs if t <= run.end_s), self)

    @cached_property
    def first_blow_s(self) -> float:
        """When it was first struck in flight, as far as sensors that clip or are shaken tell; infinite where never."""
        begin = self.flown[0][0] if self.flown else math.inf
        clips = (one.t[1:][(np.diff(one["Clip"]) > 0) & (one.t[1:] > begin)] for one in self.all("VIBE", "Clip"))
        blows = [*(float(t[0]) for t in clips if len(t)), self.shock_after(begin)]
        return min((t for t in blows if t is not None), default=math.inf)

    @cached_property
    def held(self) -> tuple[Span, ...]:
        """Spans well above the ground, before it was lost, in which a copter that was struck leans as it is told and
        yet stands, or one that leans far rests, with how it came to lean so: something holds it."""
        moved = self.one("GPS", "Spd", "Status")
        if not self.is_copter or moved is None or not self.flown:
            return ()
        tilt, error, height = self.tilt, self.lean_error, self.height
        if tilt is None or error is None or height is None:
            return ()
        lean = np.interp(moved.t, *tilt)
        lifts = (np.interp(moved.t, *height) > OFF_GROUND_M) & during(self.flown, moved.t) & (moved["Status"] >= FIX)
        rises = np.interp(moved.t + 1.0, *height) - np.interp(moved.t - 1.0, *height)
        lifts &= np.abs(rises) < 2 * STANDS_MS  # what is held rises no faster than it goes
        if self.throttle is not None:  # what lies on its side with its motors down is held by nothing
            lifts &= np.interp(moved.t, *self.throttle) > _LIFTS
        follows = np.interp(moved.t, *error) < FOLLOWED_DEG
        stands = lifts & follows & (lean > _LEANS_DEG) & (moved["Spd"] < STANDS_MS) & (moved.t > self.first_blow_s)
        if long := _lasting(moved.t, stands, _HELD_S):
            return long
        still = lifts & (moved["Spd"] < _STILL_MS)
        rests = _lasting(moved.t, still & (lean > _LEANS_FAR_DEG), _STILL_S)
        leans_on = runs(moved.t, still & (lean > _LEANS_ON_DEG), gap_s=1.0)
        rested = tuple((a, b) for a, b in leans_on if any(a <= start <= b for start, _ in rests))
        up = moved.t > self.flown[0][0] + _GROWS_S
        return rested or tuple(_grown(moved.t, lean, lifts & up & (moved["Spd"] < _GROWN_MS)))

    def refused_for(self, *words: str, but: str | None = None) -> float | None:
        """When arming was first refused with one of these words, and without another, where that still stood at the
        last refusal and it never armed."""
        if not self.was_refused:
            return None
        complaints = [(one.time_s, one.text.casefold()) for one in self.lasting_refusals]
        named = [
            t for t, text in complaints if any(word in text for word in words) and (but is None or but not in text)
        ]
        return named[0] if named and named[-1] > complaints[-1][0] - _REFUSED_S else None

    @cached_property
    def shown_right(self) -> frozenset[str]:
        """Parameters that this log shows to be right: the type of a receiver that has a fix."""
        fixed = [one for one in self.all("GPS", "Status") if np.any(one["Status"] >= FIX)]
        numbers = [int(one["I"][0]) + 1 if "I" in one.columns else 1 for one in fixed]
        return frozenset(name for n in numbers for name in (f"GPS{n}_TYPE", "GPS_TYPE" if n == 1 else f"GPS_TYPE{n}"))

    @cached_property
    def watched(self) -> tuple[Span, ...]:
        """Spans in which its sensors matter: armed and before it was lost; all of the log where arming was refused."""
        if not self.armed:
            return ((0.0, self.end_s),) if self.was_refused else ()
        lost = min((t for t in (self.lost_control_s, self.impact_s) if t is not None), default=math.inf)
        return tuple((start, min(end, lost)) for start, end in self.armed if start < lost)

    def watch(self, t: Floats) -> Bools:
        """Which of these times are watched."""
        return during(self.watched, t)

    @cached_property
    def stands_at_end(self) -> bool:
        """Whether a vehicle of whose disarming nothing is recorded stands still at the end, with its motor down."""
        moved, driven = self.one("GPS", "Spd"), self.throttle
        if self.arm_changes or moved is None or driven is None:
            return False
        last = moved["Spd"][moved.t > moved.t[-1] - _STANDS_S]
        down = driven[1][driven[0] > driven[0][-1] - _STANDS_S]
        return float(np.max(last)) < _WALKS_MS and float(np.max(down)) < _IDLES

    @cached_property
    def flown(self) -> tuple[Span, ...]:
        """Spans in the air before it was lost."""
        lost = min((t for t in (self.lost_control_s, self.impact_s) if t is not None), default=math.inf)
        return tuple((start, min(end, lost)) for start, end in self.airborne if start < lost)

    @cached_property
    def frozen(self) -> tuple[Frozen, ...]:
        """Stretches in which a source only repeats itself while the vehicle moves."""
        in_air = (*self.flown, *self._lifted) if self.is_copter else self.flown if self.is_winged else ()
        return tuple(sources.frozen(self, in_air if self.is_copter else in_air or self.watched))

    @property
    def _lifted(self) -> Iterator[Span]:
        """Spans before a copter was lost in which its motors lift: a height that died knows no flight."""
        if self.throttle is None:
            return
        t, driven = self.throttle
        for start, end in self.watched:
            yield from runs(t, (driven > _LIFTS) & (t >= start) & (t <= end), gap_s=3.0)

    def repeats(self, channel: str) -> tuple[Span, ...]:
        return tuple(one.span for one in self.frozen if one.channel == channel)

    @cached_property
    def batteries(self) -> tuple[Battery, ...]:
        """The batteries whose voltage is measured."""
        monitors = enumerate(self.all("BAT", "Volt"), start=1)
        return tuple(
            Battery.of(self, number, one) for number, one in monitors if not sources.no_pack_on(one, self.hovering)
        )

    @cached_property
    def battery_failsafe_s(self) -> float | None:
        """When the firmware's battery failsafe began, in flight."""
        times = [t for t, code in self.errors(BATTERY_FAILSAFE) if code > 0]
        times += [t for t, text in self.messages if "battery" in text.casefold() and "failsafe" in text.casefold()]
        return min((t for t in times if any(start <= t <= end + 1 for start, end in self.armed)), default=None)


def as_flight(model: RunModel) -> Flight:
    """The run model of a log of ArduPilot."""
    assert isinstance(model, Flight)
    return model

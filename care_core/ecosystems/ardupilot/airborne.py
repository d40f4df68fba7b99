"""When a vehicle was in the air, out of control and down: the third layer of the run model.

Nothing here needs a message at a rate: logs come thinned to one record in two seconds, and at 400 Hz.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from care_core.ecosystems.ardupilot import sources
from care_core.ecosystems.ardupilot.armed import Armed
from care_core.ecosystems.ardupilot.recorded import UNKNOWN_MODE
from care_core.ecosystems.ardupilot.statistics import parts
from care_core.ecosystems.ardupilot.texts import mission_item
from care_core.ecosystems.spans import Span, during, inside, runs, within
from care_core.ecosystems.vehicles import flies
from care_core.ecosystems.vehicles.errors import CRASH_CHECK
from care_core.geodesy import GRAVITY
from care_core.logs.base import Table, Wanted
from care_core.numbers import Bools, Floats, median, pieces

READS: Wanted = {
    "CTUN": ("ThO", "Alt", "BAlt", "DAlt"),
    "ATT": ("Roll", "Pitch", "DesRoll", "DesPitch"),
    "IMU": ("AccX", "AccY", "AccZ"),
    "RATE": ("R", "P"),
}

UPSIDE_DOWN_DEG = 100.0
"""No mode that levels a plane banks it so far, ROLL_LIMIT_DEG is at most 90; nor is it a slope or a wave."""
_CRASH_CHECK_S = 2.0
"""The firmware says "crash" when control was lost for this long (crash_check.cpp: CRASH_CHECK_TRIGGER_SEC)."""
_OUT_OF_CONTROL_DEG = 30.0
"""Lean error of the firmware's crash check (crash_check.cpp: CRASH_CHECK_ANGLE_DEVIATION_DEG)."""
FOLLOWED_DEG, _BACK_S = 15.0, 5.0
"""Within this of its demand for so long in the air, it had come back."""
_FLICK_S, _GOES_ON_S = 0.5, 2.0
"""A gust or a jerk of the stick that is over so soon is no loss of control, where the flight goes on for so long."""
_STAYS, _HELD = 0.6, 0.15
"""Share of the time off its demand of what does not come back, for what swings passes it to and fro; and share of the
rest of a flight near its demand, from which it flew on: what tumbles passes it less."""
_OVER_DEG = 70.0
"""No copter leans this far in any mode but acro, sport and flip: ANGLE_MAX is at most 80, 30 to 45 as shipped."""
_TAKEOFF_S = 15.0
"""A take-off takes no longer."""
_LIFTING = 0.2
"""Throttle above which a copter is about to lift; MOT_SPIN_MIN and what armed motors idle at is below."""
_CARRIES = 0.25
"""Throttle above which a copter flies where nothing tells its height: a light one hovers at it, idling is below."""
_DIPS_S, _HOPS_S = 3.0, 1.0
"""A flight goes on over so short a dip of height or throttle, and is longer than a hop."""
_LEANS_DEG = 8.0
"""More than a slope to start on."""
OFF_GROUND_M = 1.0
"""Height above which a copter touches nothing, whatever its legs."""
_RISES_S, _RISES_M = 0.5, 0.5
"""What still climbs so fast has not come down."""
_GROUND_M = 2.0
_STRIVING, _STRANDED_S = 0.5, 10.0
"""Throttle that lifts any vehicle that can fly, and how long it may take to do so."""
_CLIMBS_M = 20.0
"""A copter that has hit the ground cannot climb so far, whatever its estimator reports."""
_STRUCK_S = 1.0
"""A blow so shortly before control was lost is what took it."""
_SHOCK, _HARD = 30.0, 5.0
"""m/s^2: three times gravity is no flight, and so many times that is no motor that broke."""
_CALM_S, _SAME_BLOW_S = 5.0, 0.3
"""A blow out of the blue: none came for so long, and its sensor clips with it."""
_STOPS_S, _MOVES_MS, _STOPPED = 0.8, 2.5, 0.3
"""What a blow stops has less than this share of its speed so shortly after; a copter that brakes takes longer."""
HIT_MS = 3.0
"""Speed of a fall from half a metre: LAND_SPEED is at most 2 m/s, a simulated landing says "SIM Hit ground at 0.5"."""
_BEFORE_HIT_S, _SWAYS_S, _BLOW = 1.0, 0.2, 2.0
"""Its descent is that of the second before; a blow is so many times what it felt until shortly before."""
_REST_S, _REST_M, _ROLLS_MS, _LOW_M = 4.0, 2.0, 3.0, 5.0
"""What hit the ground rests for so long, within so much height, no faster and no higher than this."""
_HIT_LOST_S = 10.0
"""What left its demand so shortly before it hit the ground, and was not back since, had lost control."""
_GOING_DEG = 20.0
"""What is so far off its attitude demand is falling over already."""
_GRAZES, _GRAZED = 100.0, 0.7
"""m/s^2: a belly landing is as hard at most; and the share of its speed that what touches nothing keeps."""
_FAST_MS, _STILL = 5.0, 2.0
"""A walk is slower; what lies still feels gravity within so many m/s^2, and a motor that turns shakes it more."""
_LEVEL = 0.2
"""Tangent of a lean (11 degrees) that slopes and legs have."""
_STILL_S, _FEWEST = 3.0, 5
"""What nothing moves so long after its attitude is said to be lost stands, told by so many messages at least."""
_SIMULATED_HIT = re.compile(r"(?:SIM )?Hit ground at (\d+(?:\.\d+)?) m/s")
"""Simulators before firmware 4.1 said it without their name."""
_BEFORE_OVER_S, _ON_SIDE_DEG, _TILTED_DEG = 3.0, 50.0, 40.0
"""Motors that worked so shortly before a copter lay on its back or its side turned it over, or let it fall; no ground
that a copter stands on is so steep, nor, with its throttle cut, at this."""
_LIES_S, _TURNS = 3.0, 0.02
"""A flip is over sooner; above this throttle motors do more than idle, however light the vehicle."""
_FLEW_S = 5.0
"""What lies on its side fell so shortly after it flew; later it lay where it had come down, its motors up or not."""
_SPINS_DEG_S, _HALF_TURN_DEG = 400.0, 180.0
"""A copter that turns so fast about its level axes, and so far, in a mode that keeps it level has turned over."""
_TAXIES_MS = 8.0
"""Faster over ground, a plane flies or is about to; against a gale its height tells."""
_CAUGHT_S, _CAUGHT_M, _TRAVELS_MS = 2.0, 1.0, 2.0
"""What leans so far that its motors lift nothing falls by 20 m in this time, and was caught if by less than this; what
is caught goes nowhere."""
_TUMBLING_DEG, _TUMBLES_S = 45.0, 2.0
_ROLLS = frozenset((UNKNOWN_MODE, 0, 3, 4, 23))
"""Plane modes in which the pilot may roll it over: manual, training, acro, QAcro; any where the log does not say."""
ACRO = frozenset((1, 13, 14))
"""Copter modes in which any attitude is meant: acro, sport, flip."""


class Hit(NamedTuple):
    """A contact with the ground, or with something above it, at a speed that no landing has."""

    time_s: float
    speed_ms: float
    said: str
    """What says so, in a clause."""
    what: str = "the ground"


class Airborne(Armed):
    """When the vehicle was in the air, and when it was lost."""

    @cached_property
    def airborne(self) -> tuple[Span, ...]:
        """Spans in the air: armed, and higher than a metre or lifted by more than half of what hovering takes; of a
        plane, higher than two metres or faster than it taxies."""
        if self.is_winged:
            return self._on_wings
        if not self.is_copter:
            return self.armed
        throttle, height = self.throttle, self.height
        if throttle is None and height is None:
            return ()
        t = throttle[0] if throttle is not None else height[0]  # type: ignore[index]
        up = np.zeros(len(t), dtype=bool)
        if height is not None:
            for rows in pieces(len(t)):
                up[rows] = np.interp(t[rows], *height) > OFF_GROUND_M
        if throttle is not None:
            up &= throttle[1] > _TURNS
            if height is None:
                up |= throttle[1] > _CARRIES
            up |= during(self.leans_as_told, t) & (throttle[1] > _CARRIES)
        spans: list[Span] = []
        for start, end in self.armed:
            spans += runs(t, up & (t >= start) & (t <= end), gap_s=_DIPS_S)
        return tuple((a, b) for a, b in spans if b - a >= _HOPS_S)

    @cached_property
    def leans_as_told(self) -> tuple[Span, ...]:
        """When a copter leant as it was told to, to and fro: on the ground it cannot, whatever its height is said to
        be. None of it where that was for moments alone."""
        table = self.one("ATT", "Roll", "Pitch", "DesRoll", "DesPitch")
        if table is None or not self.is_copter:
            return ()
        told, off = np.hypot(table["DesRoll"], table["DesPitch"]), np.concatenate([*map(_off_demand, parts(table))])
        follows = (told > _LEANS_DEG) & (off < _LEANS_DEG / 2) & during(self.armed, table.t)
        spans = tuple(runs(table.t, follows, gap_s=_FLICK_S))
        return spans if sum(end - start for start, end in spans) > _BACK_S else ()

    @property
    def _on_wings(self) -> tuple[Span, ...]:
        moved, height = self.one("GPS", "Spd"), self.height
        if moved is None and height is None:
            return self.armed
        t = moved.t if moved is not None else height[0]  # type: ignore[index]
        up = np.zeros(len(t), dtype=bool) if moved is None else moved["Spd"] > _TAXIES_MS
        if height is not None:
            up |= np.interp(t, *height) > _GROUND_M
        return tuple(span for span in runs(t, up & during(self.armed, t), gap_s=3.0) if span[1] - span[0] >= 1.0)

    @cached_property
    def stranded(self) -> Span | None:
        """The first span on the ground, after it had flown, in which it wants up with all its might and does not rise;
        None where there is none."""
        table = self.one("CTUN", "Alt", "DAlt", "ThO")
        if table is None or not self.is_copter or not self.airborne:
            return None
        t = table.t
        wants = (table["DAlt"] - table["Alt"] > _GROUND_M) & (table["ThO"] > _STRIVING) & during(self.armed, t)
        down = (t > self.airborne[0][1]) & ~during(self.airborne, t)
        return next((span for span in runs(t, wants & down, gap_s=1.0) if span[1] - span[0] >= _STRANDED_S), None)

    @property
    def lean_error(self) -> tuple[Floats, Floats] | None:
        """Time and angle (degrees) between the thrust direction wanted and the one there is."""
        return None if self._lean_error is None else (self._lean_error[0].t, self._lean_error[1])

    @cached_property
    def _lean_error(self) -> tuple[Table, Floats] | None:
        table = self.living_attitude("Roll", "Pitch", "DesRoll", "DesPitch")
        return None if table is None else (table, np.concatenate([*map(_off_demand, parts(table))]))

    @property
    def tilt(self) -> tuple[Floats, Floats] | None:
        """Time and lean from level (degrees)."""
        return None if self._tilt is None else (self._tilt[0].t, self._tilt[1])

    @cached_property
    def _tilt(self) -> tuple[Table, Floats] | None:
        table = self.living_attitude("Roll", "Pitch")
        return None if table is None else (table, np.concatenate([*map(_off_level, parts(table))]))

    def living_attitude(self, *fields: str) -> Table | None:
        """The attitude without what it only repeats while others tell that the vehicle moves: that follows no demand,
        and has lost none."""
        table, dead = self.one("ATT", *fields), self._dead_attitude
        if table is None or not dead:
            return table
        living = table.where(~inside(dead, table.t))
        return living if len(living) else None

    @property
    def hovering(self) -> tuple[Span, ...]:
        """When motors held it in the air: of wings nobody knows."""
        return self.airborne if self.is_copter else ()

    @cached_property
    def _dead_attitude(self) -> tuple[Span, ...]:
        return tuple(one.span for one in sources.frozen(self, self.airborne, sources.ATTITUDE))

    @cached_property
    def lost_control_s(self) -> float | None:
        """When a copter in the air, or about to lift, stopped following its attitude demand for good: it never came
        back within limits before the end, the ground, or the disarming."""
        if self.is_winged:
            return self._tumbled_s
        if not self.is_copter:
            return None
        up = self.airborne
        leans, off_demand = self.tilt, self.lean_error
        if leans is None or off_demand is None:
            return None
        t, error = off_demand
        off = (error > _OUT_OF_CONTROL_DEG) | (leans[1] > _OVER_DEG)
        leant = leans[1] > FOLLOWED_DEG  # what is held down, or idles on its legs, is told to lean and does not
        matters = during(((start - 1.0, end) for start, end in up), t) | (during(self._lifting_off, t) & leant)
        flying = during(up, t)
        held = (error < FOLLOWED_DEG) & flying
        back = runs(t, held, gap_s=_FLICK_S)
        height = self.height
        for start, end in runs(t, off & matters & self._is_driven(t)):
            if self._reaches_after(start + _BACK_S) or self.stands_still(start):
                continue
            fell_s = self._fell_from(start, height)
            until = start + _CRASH_CHECK_S if fell_s is None else fell_s
            stays = off[(t >= start) & (t <= until)].mean() > _STAYS  # else it swings
            until_last = min(t[-1], self.armed[-1][1]) - _GOES_ON_S
            brief = end - start < _FLICK_S and end < until_last
            if not self._hits_after(start, end) and (not stays or (brief and fell_s is None)):
                continue
            rest = held[flying & (t > end)]
            flew_on = sum(max(b - max(a, end), 0.0) for a, b in up) > 2 * _BACK_S and rest.mean() > _HELD
            if not flew_on and not any(b - max(a, end) > _BACK_S for a, b in back):
                return start
        over = [t for t in (self._overturned_s, self._spun_s) if t is not None and not self.stands_still(t)]
        return min(over, default=None)

    def stands_still(self, at: float) -> bool:
        """Whether accelerometers and barometer feel nothing, near the ground, of what its attitude or its demand tells:
        it is held, or its gyros turn by themselves. With motors that shake it, gravity tells: what lies on its side
        feels it there."""
        felt, height = self.one("IMU", "AccX", "AccY", "AccZ"), self.barometer
        if felt is None or height is None:
            return False
        now, then = ((t > at - _STRUCK_S) & (t < at + _STILL_S) for t in (felt.t, height[0]))
        if now.sum() < _FEWEST or then.sum() < _FEWEST or float(median(height[1][then])) > _LOW_M:
            return False
        axes = (felt["AccX"], felt["AccY"], felt["AccZ"])
        is_quiet = max(float(np.ptp(one[now])) for one in axes) < _STILL
        return float(np.ptp(height[1][then])) < _REST_M and (is_quiet or self._is_level(axes, felt.t, at))

    def _is_level(self, axes: Sequence[Floats], t: Floats, at: float) -> bool:
        """Whether gravity lies along its legs from a time on while its attitude says that it leans far."""
        after = (t > at) & (t < at + _STILL_S)
        if self.tilt is None or after.sum() < _FEWEST:
            return False
        x, y, z = (float(median(axis[after])) for axis in axes)
        leans = np.interp(np.array([at, at + _STILL_S]), *self.tilt)
        stands = abs(math.hypot(x, y, z) - GRAVITY) < _STILL / 2 and z < 0 and math.hypot(x, y) < _LEVEL * -z
        return stands and float(np.min(leans)) > FOLLOWED_DEG and float(np.max(leans)) > _OVER_DEG / 2

    @property
    def _lifting_off(self) -> Iterator[Span]:
        """Spans on the ground, before it flew, in which its motors were first to lift it: later it was not meant to."""
        flew_s = self.airborne[0][0] if self.airborne else math.inf
        for start, end in self.armed:
            begun = _first_above(self.throttle, _LIFTING, start, end)
            lifts = (
                (begun, begun + _TAKEOFF_S) if begun is not None else (start, end) if self.throttle is None else None
            )
            if lifts is not None and lifts[0] < flew_s:
                yield lifts[0], min(lifts[1], end, flew_s)

    @property
    def _overturned_s(self) -> float | None:
        """When a copter whose motors had just worked turned over, and lay on its back or its side to the end; None
        where it did not: whatever its height says, that is no landing."""
        on_back = self._lay_s(UPSIDE_DOWN_DEG)
        if on_back is not None:
            return on_back
        on_side = self._lay_s(_ON_SIDE_DEG)
        if on_side is None:
            on_side = self._lay_s(_TILTED_DEG)
            if on_side is not None and not self._is_cut(on_side):
                return None
        flew = on_side is not None and any(a <= on_side <= b + _FLEW_S for a, b in self.airborne)
        return on_side if flew else None

    def _is_cut(self, since: float) -> bool:
        """Whether its throttle lifts nothing from a time on."""
        after = None if self.throttle is None else self.throttle[1][self.throttle[0] > since + _FLICK_S]
        return after is not None and len(after) > 0 and float(median(after)) < _LIFTING

    def _lay_s(self, lean_deg: float) -> float | None:
        """Since when it leaned by more than this, to the end, if its motors had just worked."""
        assert self.tilt is not None
        t, tilt = self.tilt
        if not self.armed:
            return None
        over = runs(t, (tilt > lean_deg) & (t >= self.armed[0][0]), gap_s=_STRUCK_S)
        if not over or over[-1][1] < t[-1] - _STRUCK_S or over[-1][1] - over[-1][0] < _STRUCK_S:
            return None
        start = over[-1][0]
        return start if self._is_driven(t[(t > start - _BEFORE_OVER_S) & (t <= start)]).any() else None

    @cached_property
    def turned_over_s(self) -> float | None:
        """When an upright copter with working motors turned over and then lay on its back, at rest, until it was
        disarmed and on; in acro as well, since what is upside down in the air falls and feels less than gravity."""
        table, leans, driven = self.one("IMU", "AccX", "AccY", "AccZ"), self.tilt, self.throttle
        if table is None or leans is None or driven is None or not self.is_copter:
            return None
        t, tilt = leans
        felt = np.sqrt(table["AccX"] ** 2 + table["AccY"] ** 2 + table["AccZ"] ** 2)
        for armed_s, disarmed_s in self.armed:
            seen = (t >= armed_s) & (t <= disarmed_s + _LIES_S)
            for start, end in runs(t, (tilt > UPSIDE_DOWN_DEG) & seen, gap_s=_STRUCK_S):
                in_the_air = self.hit is not None and start < self.hit.time_s <= end
                if end - start < _LIES_S or end < disarmed_s - _STRUCK_S or start > disarmed_s or in_the_air:
                    continue
                since = max(start - _BEFORE_OVER_S, armed_s)
                before = tilt[(t >= since) & (t < start)]
                throttle = driven[1][(driven[0] >= since) & (driven[0] <= start)]
                last = felt[(table.t > end - _LIES_S + _STRUCK_S) & (table.t <= end)]
                is_at_rest = len(last) > 2 and float(np.max(np.abs(last - GRAVITY))) < _STILL
                was_upright = float(np.min(before, initial=UPSIDE_DOWN_DEG)) < _ON_SIDE_DEG
                if is_at_rest and was_upright and float(np.max(throttle, initial=0.0)) > _TURNS:
                    return start
        return None

    @property
    def _spun_s(self) -> float | None:
        """When a copter whose motors worked turned over faster than its attitude, ten times a second, can tell."""
        table = self.one("RATE", "R", "P")
        if table is None or not self.armed:
            return None
        t, rate = table.t, np.maximum(np.abs(table["R"]), np.abs(table["P"]))
        matters = during(self.airborne, t) | during(self._lifting_off, t)
        for start, end in runs(t, (rate > _SPINS_DEG_S) & matters):
            at, turns = t[(t >= start) & (t <= end)], rate[(t >= start) & (t <= end)]
            turned = float(np.sum(np.diff(at) * (turns[1:] + turns[:-1]) / 2))
            if turned > _HALF_TURN_DEG and self._is_driven(at[:1]).any():
                return start
        return None

    def _reaches_after(self, time_s: float) -> bool:
        """Whether it reached another waypoint after a time, before it was disarmed: that is steered."""
        end_s = next((end for start, end in self.armed if start <= time_s <= end), time_s)
        said = (mission_item(text) for t, text in self.messages if time_s < t <= end_s)
        return any(item is not None and item[1] == "reached" for item in said)

    @cached_property
    def left_demand(self) -> tuple[float, ...]:
        """Each time that a copter in the air left its attitude demand by what the firmware's crash check allows, in a
        mode in which not every attitude is meant; whether it came back or not."""
        off_demand = self.lean_error
        if off_demand is None or not self.is_copter:
            return ()
        t, error = off_demand
        off = (error > _OUT_OF_CONTROL_DEG) & during(self.airborne, t) & self._is_driven(t)
        return tuple(start for start, end in runs(t, off, gap_s=_BACK_S) if end > start)

    @cached_property
    def _tumbled_s(self) -> float | None:
        """When a plane left its demand for good, to turn over, in a mode that levels it."""
        if self._lean_error is None:
            return None
        table, error = self._lean_error
        t = table.t
        levels = ~np.isin(self.modes_at(t), tuple(_ROLLS))
        off = (error > _TUMBLING_DEG) & levels & during(self.armed, t)
        over = t[(np.abs(table["Roll"]) > UPSIDE_DOWN_DEG) & off]
        for start, end in runs(t, off, gap_s=1.0):
            if end - start >= _TUMBLES_S and ((over >= start) & (over <= end)).any():
                return start
        return None

    def _fell_from(self, start: float, height: tuple[Floats, Floats] | None) -> float | None:
        """When it was down, if it came down from a height sooner than the firmware's check takes to call it a crash:
        what the attitude does on the ground says nothing."""
        if height is None or float(np.interp(start, *height)) < _GROUND_M:
            return None
        return next((b for a, b in self.airborne if a <= start <= b < start + _CRASH_CHECK_S), None)

    def _hits_after(self, start: float, end: float) -> bool:
        return self.hit is not None and start <= self.hit.time_s <= end + _HIT_LOST_S

    def _is_driven(self, t: Floats) -> Bools:
        """Where the motors were to lift it, in a mode in which not every attitude is meant."""
        driven, throttle = during(self.armed, t), self.throttle
        for rows in pieces(len(t)):
            driven[rows] &= ~np.isin(self.modes_at(t[rows]), tuple(ACRO))
            if throttle is not None:
                driven[rows] &= np.interp(t[rows], *throttle) > _LIFTING
        return driven

    @cached_property
    def hit(self) -> Hit | None:
        """The first time that it hit the ground at speed, whatever its attitude: by its simulator's own word, or by a
        blow at the end of a fast descent after which it rests. None where it did not."""
        said = ((t, text, _SIMULATED_HIT.match(text)) for t, text in self.messages)
        simulated = (Hit(t, float(match[1]), f"the simulator says: {text}") for t, text, match in said if match)
        hits = [one for one in simulated if one.speed_ms > HIT_MS and within(self.armed, one.time_s)]
        return min((*hits, *self._struck_ground(), *self._lies_on_its_side()), key=lambda hit: hit.time_s, default=None)

    def _struck_ground(self) -> Iterator[Hit]:
        if self._felt is None or not flies(self.kind):
            return
        t, felt = self._felt
        for at in t[(felt > _SHOCK) & during(self.armed, t)].tolist():
            if not self._stands_out(at):
                continue
            blow = float(np.max(felt[(t >= at) & (t <= at + _STRUCK_S)]))
            fell, flew = self._fell_ms(at), self._flew_ms(at)
            after = felt[(t > at + _REST_S / 2) & (t < at + _REST_S)]
            is_still = len(after) > 2 and float(np.ptp(after)) < _STILL
            if fell > HIT_MS and self._rests_after(at):
                yield Hit(at, fell, f"it came down at {fell:.1f} m/s into a blow of {blow:.0f} m/s^2")
                return
            if flew > _FAST_MS and blow > 2 * _SHOCK and is_still:
                is_high = self.height is not None and float(np.interp(at, *self.height)) > OFF_GROUND_M
                said = f"a blow of {blow:.0f} m/s^2 stopped it dead from {flew:.1f} m/s"
                yield Hit(at, flew, said, "something" if is_high else "the ground")
                return

    def _lies_on_its_side(self) -> Iterator[Hit]:
        """A plane that came down faster than any lands, and lies on its side from then on: what it felt in the air may
        be as much as the blow."""
        attitude = self.one("ATT", "Roll", "Pitch")
        if attitude is None or not self.is_winged:
            return
        leans = attitude.t, np.degrees(np.arccos(_up(attitude["Roll"], attitude["Pitch"])[2]))
        for _, at in self.airborne:
            fell, lies = self._fell_ms(at), _after(leans, at)
            if fell > HIT_MS and len(lies) and float(np.min(lies)) > _ON_SIDE_DEG and self._rests_after(at):
                lean = float(median(lies))
                yield Hit(at, fell, f"it came down at {fell:.1f} m/s, and lay at {lean:.0f} degrees from then on")

    @property
    def survived(self) -> Hit | None:
        """The first hit from which it flew on; None where there was none."""
        return self._bumped if self.is_copter else self._grazed

    @cached_property
    def _bumped(self) -> Hit | None:
        """A blow out of the blue, in the air, that threw a copter off its attitude demand, which it had followed."""
        hard = [(t, felt) for t, felt in self._blows() if not felt or felt > 2 * _SHOCK]
        flown = [one for one in hard if within(self.airborne, one[0])]
        clipped = (t for t, felt in flown if not felt and _is_first(t, flown) and self._whirls(t))
        for at in sorted({*_out_of_the_blue(flown), *clipped}):
            thrown = any(at - _FLICK_S < t < at + _FLICK_S for t in self.left_demand)
            if thrown and not self._was_going(at - _SAME_BLOW_S):
                felt = max(felt for t, felt in hard if at <= t < at + _STRUCK_S)
                blow = f"a blow of {felt:.0f} m/s^2" if felt else "a blow that a sensor clipped at"
                said = f"{blow} threw it off its attitude; it came back, and flew on"
                return Hit(at, self._flew_ms(at), said, "something")
        return None

    def _whirls(self, at: float) -> bool:
        """Whether its gyros say that it was turned faster than it turns by itself in a mode that keeps it level."""
        table = self.one("IMU", "GyrX", "GyrY", "GyrZ")
        if table is None:
            return False
        now = (table.t > at - _FLICK_S) & (table.t < at + _FLICK_S)
        turns = (np.max(np.abs(table[name][now]), initial=0.0) for name in ("GyrX", "GyrY", "GyrZ"))
        return bool(np.degrees(max(turns)) > _SPINS_DEG_S)

    @cached_property
    def _grazed(self) -> Hit | None:
        """A blow at the ground that took much of a plane's speed, though it came from above and flew on; None where
        there was none."""
        height, moved = self.height, self.one("GPS", "Spd")
        if self._felt is None or height is None or moved is None or not self.is_winged:
            return None
        t, felt = self._felt
        for at, _ in runs(t, (felt > _GRAZES) & during(self.airborne, t), gap_s=_STRUCK_S):
            before, after = self._flew_ms(at), moved["Spd"][(moved.t > at) & (moved.t < at + _STRUCK_S)]
            from_above = float(np.max(height[1][(height[0] > at - _HIT_LOST_S) & (height[0] < at)], initial=0.0))
            flies_on = float(np.max(height[1][height[0] > at + _STRUCK_S], initial=0.0))
            is_low = float(np.interp(at, *height)) < _LOW_M < 2 * _LOW_M < min(from_above, flies_on)
            if is_low and before > _TAXIES_MS and float(np.min(after, initial=before)) < _GRAZED * before:
                blow = float(np.max(felt[(t >= at) & (t <= at + _STRUCK_S)]))
                return Hit(at, before, f"a blow of {blow:.0f} m/s^2 took much of its {before:.0f} m/s, and it flew on")
        return None

    def _fell_ms(self, at: float) -> float:
        """How fast it came down in the second before, or in the last half of it."""
        if self.height is None:
            return 0.0
        spans = (_BEFORE_HIT_S, _BEFORE_HIT_S / 2)
        return max(float(np.interp(at - s, *self.height) - np.interp(at, *self.height)) / s for s in spans)

    def _flew_ms(self, at: float) -> float:
        """How fast it moved over ground in the seconds before."""
        moved = self.one("GPS", "Spd")
        speeds = np.empty(0) if moved is None else moved["Spd"][(moved.t > at - _REST_S / 2) & (moved.t < at)]
        return float(median(speeds)) if len(speeds) else 0.0

    def _rests_after(self, at: float) -> bool:
        """Whether it neither rises, falls nor moves on after a blow, low or with its motors down; what the log does not
        tell of that does not count."""
        height, throttle = _after(self.height, at), _after(self.throttle, at)
        moved = self.one("GPS", "Spd")
        speeds = _after(None if moved is None else (moved.t, moved["Spd"]), at)
        is_down = float(np.min(height, initial=0.0)) < _LOW_M or float(np.max(throttle, initial=0.0)) < _LIFTING
        return (
            is_down
            and float(np.ptp(height) if len(height) else 0.0) < _REST_M
            and (not len(speeds) or float(median(speeds)) < _ROLLS_MS)
        )

    @cached_property
    def impact_s(self) -> float | None:
        """When it hit something, or its firmware found it crashed; None where neither happened."""
        hits = () if self.hit is None else (self.hit.time_s,)
        return min((t for t in (*hits, self._impact_of_lost_s, self.turned_over_s) if t is not None), default=None)

    @property
    def ending_hit(self) -> Hit | None:
        """The hit that ended its flight; None where it was down long before that, and only moved on."""
        hit, down = self.hit, self.impact_s
        return None if hit is None or down is None or hit.time_s > down + _HIT_LOST_S else hit

    @property
    def _impact_of_lost_s(self) -> float | None:
        crash = min((t for t, code in self.errors(CRASH_CHECK) if code > 0), default=None)
        lost = self.lost_control_s
        if crash is None and lost is None:
            return None
        first = lost if lost is not None and (crash is None or lost < crash) else crash
        assert first is not None
        candidates = [] if crash is None else [max(crash - _CRASH_CHECK_S, first)]
        shock = self.shock_after(first - _STRUCK_S)
        if shock is not None:
            candidates.append(shock)
        ground = self._ground_after(first)
        if ground is not None:
            candidates.append(ground)
        return min((at for at in candidates if not self._flies_on(at)), default=None)

    def _flies_on(self, at: float) -> bool:
        """Whether it still climbs well after: what shook it, or brought it low, was not the end of the flight."""
        known = self.height
        if known is None:
            return False
        t, height = known
        after = height[t >= at + _BACK_S]
        return len(after) > 0 and float(after.max()) - float(np.interp(at, t, height)) > _CLIMBS_M

    @cached_property
    def down_s(self) -> float | None:
        """When the flight was over against its will: it hit something, or came down and could not rise again."""
        strandings = () if self.stranded is None else (self.stranded[0],)
        return min((t for t in (self.impact_s, *strandings) if t is not None), default=None)

    def shock_after(self, first: float) -> float | None:
        """When it was first shaken beyond what flight does, from a time on; None where it was not."""
        if self._felt is None:
            return None
        t, felt = self._felt
        shaken = t[(felt > _SHOCK) & (t >= first)].tolist()
        return next((t for t in shaken if not self.is_winged or (self._stands_out(t) and self._ends_flight(t))), None)

    def _ends_flight(self, at: float) -> bool:
        """Whether a blow may be the end of a plane's flight: it came low, or on a hill where the plane rests since."""
        is_low = self.height is None or float(np.interp(at, *self.height)) < _CLIMBS_M
        return is_low or self._rests_after(at)

    def _ground_after(self, first: float) -> float | None:
        known = self.height
        if known is None:
            return None
        t, height = known
        rises = np.interp(t + _RISES_S, t, height) - height > _RISES_M
        low = (t >= first) & (height < _GROUND_M) & ~rises
        return float(t[low][0]) if low.any() else None

    @cached_property
    def struck_s(self) -> float | None:
        """When it hit something before control was lost: by a blow, or as it was caught; None where it did not."""
        if self.blow_s is not None or self.lost_control_s is None or not self.is_caught:
            return self.blow_s
        return self._last_followed_s(self.lost_control_s)

    @cached_property
    def blow_s(self) -> float | None:
        """When a blow came just before control was lost, or one that stopped it or that nothing in flight comes near;
        None where no blow did."""
        lost = self.lost_control_s
        if lost is None:
            return None
        before = [(t, felt) for t, felt in self._blows() if lost - _HIT_LOST_S < t < lost and not self._was_going(t)]
        just_before = (t for t, felt in before if felt > _SHOCK and t >= lost - _STRUCK_S and self._stands_out(t))
        flown = [(t, felt) for t, felt in before if within(self.airborne, t)]
        moved = self.one("GPS", "Spd")
        hard = (t for t, felt in flown if felt > _HARD * _SHOCK or _stops_at(moved, t))
        return min((*hard, *just_before, *_out_of_the_blue(flown)), default=None)

    @cached_property
    def _felt(self) -> tuple[Floats, Floats] | None:
        """Time and size of what its accelerometers feel, m/s^2."""
        table = self.one("IMU", "AccX", "AccY", "AccZ")
        return (
            None if table is None else (table.t, np.sqrt(table["AccX"] ** 2 + table["AccY"] ** 2 + table["AccZ"] ** 2))
        )

    def _stands_out(self, at: float) -> bool:
        """Whether nothing that was felt until shortly before comes near a blow, as gusts on wings do."""
        if self._felt is None:
            return False
        t, felt = self._felt
        blow = float(np.max(felt[(t >= at) & (t <= at + _STRUCK_S)]))
        usual = felt[(t >= at - _REST_S) & (t < at - _SWAYS_S)]
        return not len(usual) or blow > _BLOW * float(np.max(usual))

    def _was_going(self, at: float) -> bool:
        """Whether it was off its attitude demand already as it was struck: then it fell on what struck it."""
        if self.lean_error is None:
            return False
        t, error = self.lean_error
        before = error[(t < at) & (t > at - _HIT_LOST_S)]
        return len(before) > 0 and float(before[-1]) > _GOING_DEG

    def _last_followed_s(self, until: float) -> float:
        """When it last followed its attitude demand before a time."""
        if self.lean_error is None:
            return until
        t, error = self.lean_error
        followed = t[(t < until) & (error < FOLLOWED_DEG)]
        return float(followed[-1]) if len(followed) else until

    @cached_property
    def is_caught(self) -> bool:
        """Whether a copter that turned over stays where it was, its motors lifting nothing: it lies on what it hit."""
        lost, known, leans = self.lost_control_s, self.height, self.tilt
        if lost is None or known is None or leans is None or not self.is_copter:
            return False
        heights = known[1][(known[0] >= lost) & (known[0] <= lost + _CAUGHT_S)]
        lies = leans[1][(leans[0] >= lost + _CAUGHT_S / 2) & (leans[0] <= lost + _CAUGHT_S)]
        if len(heights) < 3 or len(lies) < 3 or self._travels(lost + _CAUGHT_S / 2, lost + _CAUGHT_S):
            return False
        return bool(np.min(lies) > _OVER_DEG and np.min(heights) > _GROUND_M and np.ptp(heights) < _CAUGHT_M)

    def _travels(self, start: float, end: float) -> bool:
        """Whether its receiver says that it goes on its way all the time."""
        moved = self.one("GPS", "Spd")
        going = None if moved is None else moved["Spd"][(moved.t >= start) & (moved.t <= end)]
        return going is not None and len(going) > 2 and bool(np.min(going) > _TRAVELS_MS)

    def _blows(self) -> Iterator[tuple[float, float]]:
        """Each time that it was shaken beyond what flight does, and by how much, m/s^2; 0 where all that is
        told is that a sensor clipped, which vibration does as well."""
        if self._felt is not None:
            t, felt = self._felt
            shaken = felt > _SHOCK
            yield from zip(t[shaken].tolist(), felt[shaken].tolist(), strict=True)
        for one in self.all("VIBE", "Clip"):
            clipped = np.append(False, np.diff(one["Clip"]) > 0)
            yield from ((t, 0.0) for t in one.t[clipped].tolist())


def _out_of_the_blue(blows: Sequence[tuple[float, float]]) -> Iterator[float]:
    """Blows that were too much for a sensor after a while without any: what shakes itself does so again and again."""
    shocks, clipped = [t for t, felt in blows if felt > _SHOCK], [t for t, felt in blows if not felt]
    for at in shocks:
        if _is_first(at, blows) and any(abs(t - at) < _SAME_BLOW_S for t in clipped):
            yield at


def _is_first(at: float, blows: Sequence[tuple[float, float]]) -> bool:
    """Whether no other blow came for a while."""
    return not any(at - _CALM_S < t < at - _SAME_BLOW_S for t, _ in blows)


def _first_above(series: tuple[Floats, Floats] | None, least: float, start: float, end: float) -> float | None:
    """When a series is first above a value in a span."""
    if series is None:
        return None
    t, values = series
    above = t[(t >= start) & (t <= end) & (values > least)]
    return float(above[0]) if len(above) else None


def _after(series: tuple[Floats, Floats] | None, at: float) -> Floats:
    """The values of a series while what was struck rests."""
    if series is None:
        return np.empty(0)
    t, values = series
    return values[(t > at + _BEFORE_HIT_S) & (t < at + _REST_S)]


def _off_demand(part: Table) -> Floats:
    aligned = (_up(part["Roll"], part["Pitch"]) * _up(part["DesRoll"], part["DesPitch"])).sum(axis=0)
    return np.asarray(np.degrees(np.arccos(np.clip(aligned, -1.0, 1.0))))


def _off_level(part: Table) -> Floats:
    return np.asarray(np.degrees(np.arccos(_up(part["Roll"], part["Pitch"])[2])))


def _up(roll: Floats, pitch: Floats) -> Floats:
    """The thrust axis in a level frame that turns with the vehicle, shape (3, n)."""
    r, p = np.radians(roll), np.radians(pitch)
    return np.stack((np.cos(r) * np.sin(p), -np.sin(r), np.cos(r) * np.cos(p)))


def _stops_at(moved: Table | None, at: float) -> bool:
    """Whether it moved over ground until a time, and stood just after it."""
    if moved is None:
        return False
    before = moved["Spd"][(moved.t > at - _STOPS_S) & (moved.t < at)]
    after = moved["Spd"][(moved.t >= at) & (moved.t < at + _STOPS_S)]
    if not len(before) or not len(after):
        return False
    return float(before[-1]) > _MOVES_MS and float(np.min(after)) < _STOPPED * float(before[-1])

"""When a vehicle was armed, in the air and out of control: what every check of ArduPilot logs stands on.

Nothing here needs a message at a rate: logs come thinned to one record in two seconds, and at 400 Hz. What a log does
not hold is None or empty, and the checks that need it find nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from care_core.ecosystems.ardupilot.messages import Floats, instances
from care_core.ecosystems.vehicles import Vehicle, vehicle_of, way_of, with_said
from care_core.ecosystems.vehicles.self_written import SIMULATOR_PREFIX
from care_core.logs.base import Table, Wanted
from care_core.numbers import median, pieces
from care_core.records import Record, field
from care_core.run import Setting

Mask = NDArray[np.bool_]
Span = tuple[float, float]
_T = TypeVar("_T")

READS: Wanted = {
    "ARM": ("ArmState", "Forced"),
    "STAT": ("Armed",),
    "EV": ("Id",),
    "ERR": ("Subsys", "ECode"),
    "MODE": ("ModeNum",),
    "MSG": ("Message",),
    "CTUN": ("ThO", "ThI", "Alt", "BAlt", "DAlt", "SAlt", "CRt", "DCRt", "ThH"),
    "ATT": ("Roll", "Pitch", "Yaw", "DesRoll", "DesPitch", "DesYaw"),
    "POS": ("Lat", "Lng", "RelHomeAlt"),
    "RCOU": tuple(f"C{n}" for n in range(1, 15)),
    "IMU": ("GyrX", "GyrY", "GyrZ", "AccX", "AccY", "AccZ"),
    "GPS": ("Spd",),
    "VIBE": ("Clip",),
}
"""What the course of a flight is told by."""

_EV_ARMED, _EV_DISARMED, _EV_NOT_LANDED, _EV_LANDED = 10, 11, 28, 18
_OPENED_S, _CLOSED_S = 0.5, 2.0
"""A logger writes so shortly before the record of the arming that opened it, and was silent for longer than so."""
_ERR_CRASH = 12
_CRASH_CHECK_S = 2.0
"""The firmware says "crash" when control was lost for this long (crash_check.cpp: CRASH_CHECK_TRIGGER_SEC)."""
_OUT_OF_CONTROL_DEG = 30.0
"""Lean error of the firmware's crash check (crash_check.cpp: CRASH_CHECK_ANGLE_DEVIATION_DEG)."""
_HELD_DEG, _BACK_S = 15.0, 5.0
"""Within this of its demand for so long in the air, it had come back."""
_OVER_DEG = 70.0
"""No copter leans this far in any mode but acro, sport and flip: ANGLE_MAX is at most 80, 30 to 45 as shipped."""
_LIFTING = 0.2
"""Throttle above which a copter is about to lift; MOT_SPIN_MIN and what armed motors idle at is below."""
_MOTORS = frozenset((*range(33, 41), *range(82, 86), 70, 73, 74))
"""SERVOn_FUNCTION of motors and throttles (SRV_Channel.h)."""
_LEAST_PWM, _WORKS_PWM = 1000.0, 150.0
"""Microseconds; so far above the least of an output is more than idling (MOT_SPIN_ARM 0.1 of 1000)."""
_AIRBORNE_M = 1.0
_REFUSED_S = 30.0
"""The firmware repeats its complaints at least as often (AP_Arming: every 30 s)."""
_GROUND_M = 2.0
_STRIVING, _STRANDED_S = 0.5, 10.0
"""Throttle that lifts any vehicle that can fly, and how long it may take to do so."""
_CLIMBS_M = 20.0
"""What is down does not climb so far, whatever its estimator makes of the blow."""
_STRUCK_S = 1.0
"""A blow so shortly before control was lost is what took it."""
_SHOCK = 30.0
"""m/s^2: three times gravity is no flight."""
STANDS_MS = 0.5
_LEANS_DEG, _HELD_S = 15.0, 10.0
"""A lean of 15 degrees speeds a copter up by 2.6 m/s^2, to 26 m/s in 10 s, and ANGLE_MAX allows 30 or 45 as shipped. A
gale holds such a lean still as well, but strikes nothing."""
_WINGED = frozenset(("plane", "quadplane"))
_TUMBLING_DEG, UPSIDE_DOWN_DEG, _TUMBLES_S = 45.0, 100.0, 2.0
"""No plane is told to bank as far as the second by a mode that levels it: ROLL_LIMIT_DEG is at most 90. Nor is that a
slope or a wave."""
UNTOLD = -1
"""The mode where the log does not say."""
_ROLLS = frozenset((UNTOLD, 0, 3, 4, 23))
"""Plane modes in which the pilot may roll it over: manual, training, acro, QAcro; any where the log does not say."""
_BY_ITSELF = frozenset(("mission", "return", "guided"))
_ACRO = frozenset((1, 13, 14))
"""Copter modes in which any attitude is meant: acro, sport, flip."""


class Flight(Record, eq=False, dict=True):
    """One log. Times are seconds since its start; spans are (start, end)."""

    tables: Mapping[str, Table]
    settings: Mapping[str, tuple[Setting, ...]]
    facts: Mapping[str, str]
    end_s: float
    is_telemetry: bool = False
    """Whether a ground station heard it: then holes are the link's."""
    breaks_off: bool = False
    """Whether the log is damaged at its end: what was not yet may still have come."""
    clock_jumps: bool = False
    """Whether its clock jumps inside it: two logs in one, or damage; then what lies between two records is unknown."""
    _known: dict[str, tuple[Table, ...]] = field(default_factory=dict)

    def all(self, name: str, *fields: str) -> tuple[Table, ...]:
        """The instances of a message that have these fields."""
        if name not in self._known:
            self._known[name] = instances(self.tables, name)
        return tuple(t for t in self._known[name] if len(t) and all(one in t.columns for one in fields))

    def one(self, name: str, *fields: str) -> Table | None:
        """The first instance of a message, None where the log lacks it or one of these fields."""
        return next(iter(self.all(name, *fields)), None)

    def setting(self, *names: str) -> float | None:
        """The value of a parameter as first driven, by the first of its names that the log holds."""
        for name in names:
            values = self.settings.get(name)
            if values and isinstance(values[0].value, (int, float)) and math.isfinite(values[0].value):
                return float(values[0].value)
        return None

    @cached_property
    def vehicle(self) -> Vehicle:
        """What the log says that it is."""
        return vehicle_of(self.facts, self.settings, self.outputs)

    @cached_property
    def outputs(self) -> int | None:
        """How many motor outputs the log records, where it names them so (firmware before 3.2)."""
        motors = self.tables.get("MOT")
        return None if motors is None else sum(name.startswith("Mot") for name in motors.columns)

    @property
    def is_simulated(self) -> bool:
        """Whether ArduPilot's simulator wrote the log: only its builds have parameters of the simulation."""
        return any(name.startswith(SIMULATOR_PREFIX) for name in self.settings)

    @property
    def is_copter(self) -> bool:
        """Whether rotors alone lift it; a log that does not say is told by what only copters have."""
        kind = self.vehicle.kind
        return kind in ("copter", "heli") or (kind == "unknown" and "MOT_THST_HOVER" in self.settings)

    @cached_property
    def messages(self) -> tuple[tuple[float, str], ...]:
        """The vehicle's texts with their times."""
        table = self.one("MSG", "Message")
        return () if table is None else tuple(zip(table.t.tolist(), map(str, table["Message"].tolist()), strict=True))

    def errors(self, subsystem: int) -> list[tuple[float, int]]:
        """Times and codes of the ERR records of a subsystem."""
        table = self.one("ERR", "Subsys", "ECode")
        if table is None:
            return []
        own = table.where(table["Subsys"] == subsystem)
        return list(zip(own.t.tolist(), own["ECode"].astype(int).tolist(), strict=True))

    def events(self, *ids: int) -> list[float]:
        """Times of the EV records with one of these numbers."""
        table = self.one("EV", "Id")
        return [] if table is None else table.t[np.isin(table["Id"], ids)].tolist()

    @cached_property
    def modes(self) -> tuple[tuple[float, int], ...]:
        """When each mode was entered, by number."""
        table = self.one("MODE", "ModeNum")
        if table is None or table["ModeNum"].dtype == object:
            return ()
        return tuple(zip(table.t.tolist(), table["ModeNum"].astype(int).tolist(), strict=True))

    def mode_at(self, t: float) -> int | None:
        """The number of the mode at a time, None where the log does not say."""
        before = [mode for at, mode in self.modes if at <= t]
        return before[-1] if before else None

    def modes_at(self, t: Floats) -> NDArray[np.int64]:
        """The number of the mode at each of these times, `UNTOLD` where the log does not say."""
        codes = np.array([UNTOLD, *(mode for _, mode in self.modes)], dtype=np.int64)
        return codes[np.searchsorted([start for start, _ in self.modes], t, side="right")]

    def drives_itself(self, t: Floats) -> Mask:
        """Which of these times lie in an armed span and a mode of a rover that drives without a pilot."""
        driven = np.isin(self.modes_at(t), [mode for _, mode in self.modes if way_of("rover", mode) in _BY_ITSELF])
        return np.asarray(self.during(self.armed, t) & driven)

    @cached_property
    def armed(self) -> tuple[Span, ...]:
        """Spans armed. A log whose first word is a disarming was armed from its start. One that tells of none was armed
        as its status says (STAT of Plane), else all along where it is written while armed only, else where its throttle
        is up.

        What is armed once more was disarmed between, as far as nothing is recorded before: the logger was closed."""
        changes = self.arm_changes
        status = self.one("STAT", "Armed")
        if not changes and status is not None:
            return tuple(runs(status.t, status["Armed"] > 0, gap_s=_CLOSED_S))
        if not changes:
            return ((0.0, self.end_s),) if self.is_written_armed else self._driven()
        spans: list[Span] = []
        start: float | None = 0.0 if not changes[0][1] else None
        for t, is_armed in changes:
            if is_armed and start is not None:
                spans.append((start, self._recorded_before(t)))
            if is_armed:
                start = t
            elif not is_armed and start is not None:
                spans.append((start, t))
                start = None
        if start is not None:
            spans.append((start, self.end_s))
        return tuple(span for span in spans if span[1] > span[0])

    @cached_property
    def arm_changes(self) -> tuple[tuple[float, bool], ...]:
        """When it was armed and disarmed, as the log says it."""
        table = self.one("ARM", "ArmState")
        if table is not None:
            changes = [(t, state > 0) for t, state in zip(table.t.tolist(), table["ArmState"].tolist(), strict=True)]
        else:
            changes = [(t, True) for t in self.events(_EV_ARMED)] + [(t, False) for t in self.events(_EV_DISARMED)]
        return tuple(with_said(sorted(changes), self.messages))

    def _recorded_before(self, t: float) -> float:
        """The last record of the attitude before the logger was opened at a time; that time where it was open."""
        table = self.one("ATT")
        before = table.t[table.t < t - _OPENED_S] if table is not None else np.empty(0)
        return t if not len(before) or t - float(before[-1]) < _CLOSED_S else float(before[-1])

    @property
    def is_written_armed(self) -> bool:
        """Whether the log is one that is written while armed only: LOG_DISARMED is 0, no refused arming kept it open
        (AP_Logger: log_while_disarmed), and its motors work."""
        is_refused = any(text.startswith(("Arm: ", "PreArm: ")) for _, text in self.messages)
        is_only = not self.is_telemetry and self.setting("LOG_DISARMED") == 0 and not is_refused
        return is_only and (bool(self._driven()) or self._motors_work)

    @property
    def _motors_work(self) -> bool:
        """Whether an output that drives a motor ever left its least."""
        table = self.one("RCOU")
        outputs = [n for n in range(1, 15) if self.setting(f"SERVO{n}_FUNCTION") in _MOTORS] if table else []
        return table is not None and any(
            f"C{n}" in table.columns
            and np.nanmax(table[f"C{n}"]) > (self.setting(f"SERVO{n}_MIN") or _LEAST_PWM) + _WORKS_PWM
            for n in outputs
        )

    def _driven(self) -> tuple[Span, ...]:
        throttle = self.throttle
        if throttle is None:
            return ()
        up = np.flatnonzero(throttle[1] > 0.05)
        return ((float(throttle[0][up[0]]), float(throttle[0][up[-1]])),) if len(up) else ()

    @property
    def throttle(self) -> tuple[Floats, Floats] | None:
        """Time and throttle out (0 to 1) of the motors together. Read each time: of a large log not all is held."""
        table = self.one("CTUN", "ThO")
        return None if table is None else (table.t, table["ThO"])

    @property
    def height(self) -> tuple[Floats, Floats] | None:
        """Time and height (m) above where it was armed, as estimated by the vehicle."""
        if self._height is None:
            return None
        table, column, zero = self._height
        return table.t, table[column] - zero

    @cached_property
    def _height(self) -> tuple[Table, str, float] | None:
        """The message and the field that tell the height, and what they say where it was armed."""
        for name, column in (("POS", "RelHomeAlt"), ("CTUN", "Alt"), ("CTUN", "BAlt")):
            table = self.one(name, column)
            if table is not None and len(table) > 1 and np.ptp(table[column]) > 0:
                start = self.armed[0][0] if self.armed else 0.0
                before = table[column][table.t <= start + 1.0]
                zero = float(median(before[-20:])) if len(before) else float(table[column][0])
                return table, column, zero if abs(zero) < 50 or name == "CTUN" else 0.0
        return None

    @cached_property
    def airborne(self) -> tuple[Span, ...]:
        """Spans in the air: armed, and higher than a metre or lifted by more than half of what hovering takes."""
        if not self.is_copter:
            return self.armed
        throttle, height = self.throttle, self.height
        if throttle is None and height is None:
            return ()
        t = throttle[0] if throttle is not None else height[0]  # type: ignore[index]
        up = np.zeros(len(t), dtype=bool)
        if height is not None:
            for rows in pieces(len(t)):
                up[rows] = np.interp(t[rows], *height) > _AIRBORNE_M
        if throttle is not None:
            up &= throttle[1] > 0.02
            if height is None:
                up |= throttle[1] > 0.25
        spans: list[Span] = []
        for start, end in self.armed:
            spans += runs(t, up & (t >= start) & (t <= end), gap_s=3.0)
        return tuple((a, b) for a, b in spans if b - a >= 1.0)

    @cached_property
    def stranded(self) -> Span | None:
        """The first span on the ground, after it had flown, in which it wants up with all its might and does not rise;
        None where there is none."""
        table = self.one("CTUN", "Alt", "DAlt", "ThO")
        if table is None or not self.is_copter or not self.airborne:
            return None
        t = table.t
        wants = (table["DAlt"] - table["Alt"] > _GROUND_M) & (table["ThO"] > _STRIVING) & self.during(self.armed, t)
        down = (t > self.airborne[0][1]) & ~self.during(self.airborne, t)
        return first(runs(t, wants & down, gap_s=1.0), lambda span: span[1] - span[0] >= _STRANDED_S)

    def during(self, spans: Iterable[Span], t: Floats) -> Mask:
        """Which of these times lie within one of the spans."""
        inside = np.zeros(len(t), dtype=bool)
        for start, end in spans:
            inside |= (t >= start) & (t <= end)
        return inside

    @property
    def lean_error(self) -> tuple[Floats, Floats] | None:
        """Time and angle (degrees) between the thrust direction wanted and the one there is."""
        return None if self._lean_error is None else (self._lean_error[0].t, self._lean_error[1])

    @cached_property
    def _lean_error(self) -> tuple[Table, Floats] | None:
        table = self.one("ATT", "Roll", "Pitch", "DesRoll", "DesPitch")
        return None if table is None else (table, np.concatenate([*map(_off_demand, parts(table))]))

    @property
    def tilt(self) -> tuple[Floats, Floats] | None:
        """Time and lean from level (degrees)."""
        return None if self._tilt is None else (self._tilt[0].t, self._tilt[1])

    @cached_property
    def _tilt(self) -> tuple[Table, Floats] | None:
        table = self.one("ATT", "Roll", "Pitch")
        return None if table is None else (table, np.concatenate([*map(_off_level, parts(table))]))

    @cached_property
    def lost_control_s(self) -> float | None:
        """When a copter in the air, or about to lift, stopped following its attitude demand for good: it never came
        back within limits before the end, the ground, or the disarming."""
        if self.vehicle.kind in _WINGED:
            return self._tumbled_s
        if not self.is_copter:
            return None
        up = self.airborne
        leans, off_demand = self.tilt, self.lean_error
        if leans is None or off_demand is None:
            return None
        t, error = off_demand
        off = (error > _OUT_OF_CONTROL_DEG) | (leans[1] > _OVER_DEG)
        before_flight = t < (up[0][0] if up else math.inf)
        matters = self.during(((start - 1.0, end) for start, end in up), t) | before_flight
        flying = self.during(up, t)
        held = (error < _HELD_DEG) & flying
        back = runs(t, held, gap_s=0.5)
        height = self.height
        for start, end in runs(t, off & matters & self._is_driven(t)):
            fell_s = self._fell_from(start, height)
            until = start + _CRASH_CHECK_S if fell_s is None else fell_s
            stays = off[(t >= start) & (t <= until)].mean() > 0.6  # else it swings
            brief = end - start < 0.5 and end < t[-1] - 2.0 and end < self.armed[-1][1] - 2.0
            if not stays or (brief and fell_s is None):
                continue
            rest = held[flying & (t > end)]
            flew_on = sum(max(b - max(a, end), 0.0) for a, b in up) > 2 * _BACK_S and rest.mean() > 0.15
            if not flew_on and not any(b - max(a, end) > _BACK_S for a, b in back):
                return start
        return None

    @cached_property
    def _tumbled_s(self) -> float | None:
        """When a plane left its demand for good, to turn over, in a mode that levels it."""
        table = self.one("ATT", "Roll", "Pitch", "DesRoll", "DesPitch")
        off_demand = self.lean_error
        if table is None or off_demand is None:
            return None
        t, error = off_demand
        levels = ~np.isin(self.modes_at(t), tuple(_ROLLS))
        off = (error > _TUMBLING_DEG) & levels & self.during(self.armed, t)
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

    def _is_driven(self, t: Floats) -> Mask:
        """Where the motors were to lift it, in a mode in which not every attitude is meant."""
        driven, throttle = self.during(self.armed, t), self.throttle
        for rows in pieces(len(t)):
            driven[rows] &= ~np.isin(self.modes_at(t[rows]), tuple(_ACRO))
            if throttle is not None:
                driven[rows] &= np.interp(t[rows], *throttle) > _LIFTING
        return driven

    @cached_property
    def impact_s(self) -> float | None:
        """When it hit something, or its firmware found it crashed; None where neither happened."""
        crash = min((t for t, code in self.errors(_ERR_CRASH) if code > 0), default=None)
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
        table = self.one("IMU", "AccX", "AccY", "AccZ")
        if table is None:
            return None
        hit = (np.sqrt(table["AccX"] ** 2 + table["AccY"] ** 2 + table["AccZ"] ** 2) > _SHOCK) & (table.t >= first)
        return float(table.t[hit][0]) if hit.any() else None

    def _ground_after(self, first: float) -> float | None:
        known = self.height
        if known is None:
            return None
        t, height = known
        low = (t >= first) & (height < _GROUND_M)
        return float(t[low][0]) if low.any() else None

    @cached_property
    def was_struck(self) -> bool:
        """Whether a blow came before control was lost: it hit something while its attitude was still followed."""
        lost, shock = self.lost_control_s, None
        if lost is not None:
            shock = self.shock_after(lost - _STRUCK_S)
        return lost is not None and shock is not None and shock < lost

    @cached_property
    def held(self) -> tuple[Span, ...]:
        """Spans well above the ground, before it was lost, in which a copter that was struck leans as it is told and
        yet stands: something holds it."""
        moved = self.one("GPS", "Spd")
        if not self.is_copter or moved is None or not self.flown:
            return ()
        tilt, error, height = self.tilt, self.lean_error, self.height
        if tilt is None or error is None or height is None:
            return ()
        begin = self.flown[0][0]
        clips = (one.t[1:][(np.diff(one["Clip"]) > 0) & (one.t[1:] > begin)] for one in self.all("VIBE", "Clip"))
        blows = [*(float(t[0]) for t in clips if len(t)), self.shock_after(begin)]
        struck = min((t for t in blows if t is not None), default=math.inf)
        leans = (np.interp(moved.t, *tilt) > _LEANS_DEG) & (np.interp(moved.t, *height) > _AIRBORNE_M)
        leans &= np.interp(moved.t, *error) < _HELD_DEG
        stands = (moved["Spd"] < STANDS_MS) & (moved.t > struck) & self.during(self.flown, moved.t)
        return tuple((a, b) for a, b in runs(moved.t, leans & stands, gap_s=1.0) if b - a >= _HELD_S)

    @cached_property
    def was_refused(self) -> bool:
        """Whether it never armed though that was asked for."""
        return not self.armed and any(text.startswith(("Arm: ", "PreArm: ")) for _, text in self.messages)

    def refused_for(self, *words: str, but: str | None = None) -> float | None:
        """When arming was first refused with one of these words, and without another, where that still stood at the
        last refusal and it never armed."""
        if not self.was_refused:
            return None
        refusals = [(t, text) for t, text in self.messages if text.startswith(("Arm: ", "PreArm: "))]
        named = [t for t, text in refusals if any(word in text.casefold() for word in words)
                 and (but is None or but not in text.casefold())]  # fmt: skip
        return named[0] if named and named[-1] > refusals[-1][0] - _REFUSED_S else None

    @cached_property
    def watched(self) -> tuple[Span, ...]:
        """Spans in which its sensors matter: armed and before it was lost; all of the log where arming was refused."""
        if not self.armed:
            return ((0.0, self.end_s),) if self.was_refused else ()
        lost = min((t for t in (self.lost_control_s, self.impact_s) if t is not None), default=math.inf)
        return tuple((start, min(end, lost)) for start, end in self.armed if start < lost)

    def watch(self, t: Floats) -> Mask:
        """Which of these times are watched."""
        return self.during(self.watched, t)

    @cached_property
    def flown(self) -> tuple[Span, ...]:
        """Spans in the air before it was lost."""
        lost = min((t for t in (self.lost_control_s, self.impact_s) if t is not None), default=math.inf)
        return tuple((start, min(end, lost)) for start, end in self.airborne if start < lost)

    @cached_property
    def hover(self) -> Mask | None:
        """Rows of RCOU in steady flight: in the air, upright, under control, before anything was lost."""
        table = self.one("RCOU", "C1")
        if table is None:
            return None
        steady = self.during(self.airborne, table.t)
        if (tilt := self.tilt) is not None:
            steady &= np.interp(table.t, *tilt) < 25.0
        if self.impact_s is not None:
            steady &= table.t < self.impact_s
        return steady


def parts(table: Table) -> Iterator[Table]:
    """The messages piece by piece: of a long log no more than one piece of a column is decoded."""
    return (table.where(rows) for rows in pieces(len(table)))


def _off_demand(part: Table) -> Floats:
    aligned = (_up(part["Roll"], part["Pitch"]) * _up(part["DesRoll"], part["DesPitch"])).sum(axis=0)
    return np.asarray(np.degrees(np.arccos(np.clip(aligned, -1.0, 1.0))))


def _off_level(part: Table) -> Floats:
    return np.asarray(np.degrees(np.arccos(_up(part["Roll"], part["Pitch"])[2])))


def _up(roll: Floats, pitch: Floats) -> Floats:
    """The thrust axis in a level frame that turns with the vehicle, shape (3, n)."""
    r, p = np.radians(roll), np.radians(pitch)
    return np.stack((np.cos(r) * np.sin(p), -np.sin(r), np.cos(r) * np.cos(p)))


def runs(t: Floats, mask: Mask, gap_s: float = 0.0) -> list[Span]:
    """Spans in which a mask holds; those closer than `gap_s` are one."""
    if not mask.any():
        return []
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    spans: list[Span] = []
    for start, end in zip(t[edges[::2]].tolist(), t[edges[1::2] - 1].tolist(), strict=True):
        if spans and start - spans[-1][1] <= gap_s:
            spans[-1] = (spans[-1][0], end)
        else:
            spans.append((start, end))
    return spans


def longest(spans: Iterable[Span]) -> Span | None:
    """The longest span."""
    return max(spans, key=lambda span: span[1] - span[0], default=None)


def first(values: Iterable[_T], wanted: Callable[[_T], bool]) -> _T | None:
    """The first value that is wanted."""
    return next((value for value in values if wanted(value)), None)

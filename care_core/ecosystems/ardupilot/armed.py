"""When a vehicle was armed, how high it was, and what its motors were asked for: the second layer of the run model."""

from __future__ import annotations

import math
import re
from functools import cached_property
from typing import NamedTuple

import numpy as np

from care_core.ecosystems.ardupilot.instances import FIX
from care_core.ecosystems.ardupilot.recorded import Recorded
from care_core.ecosystems.ardupilot.texts import Refusal
from care_core.ecosystems.spans import Span, during, runs
from care_core.ecosystems.vehicles import method_words, unrecorded_changes
from care_core.geodesy import GRAVITY
from care_core.logs.base import Table, Wanted
from care_core.metadata.output_functions import LEFT, MOTORS, RIGHT, THROTTLE
from care_core.numbers import Bools, Floats, median

_AXES = ("AccX", "AccY", "AccZ")
READS: Wanted = {
    "ARM": ("ArmState", "Forced", "Method"),
    "STAT": ("Armed", "State"),
    "SYS_STATUS": ("onboard_control_sensors_enabled", "onboard_control_sensors_health"),
    "CTUN": ("ThO", "Alt", "BAlt"),
    "POS": ("RelHomeAlt",),
    "ATT": ("Roll",),
    "RCOU": tuple(f"C{n}" for n in range(1, 15)),
    "BARO": ("Alt",),
    "GPS": ("Alt", "Status", "Spd"),
    "IMU": _AXES,
}

_EV_ARMED, _EV_DISARMED = 10, 11
_OPENED_S, _CLOSED_S = 0.5, 2.0
"""A logger writes so shortly before the record of the arming that opened it, and was silent for longer than so."""
_FEWEST, _TIMES = 10, 10.0
"""A pause is a closed logger where it is so many times what usually lies between two records."""
_SPOOLS_S, _NO_CLIMB_M = 1.5, 1.0
"""No copter climbs so far from one record to the next so shortly after it was armed: its motors still spool up."""
_ESTIMATES: Wanted = {"POS": ("RelHomeAlt",), "CTUN": ("Alt", "BAlt")}
"""Where the vehicle writes the height that it estimates; the barometer counts where it writes none."""
_NEAR_HOME_M = 50.0
_ALIVE_M, _ON_GROUND_M, _APART_M = 0.05, 1.2, 3.0
"""A barometer that moves by more lives, and by less than the second on the ground, propellers and all."""
_CARRIED_OFF_M, _NO_GRAVITY = 5.0, 0.8
"""Five times what arming allows; and m/s^2 that an accelerometer which nobody calibrated is off."""
_REST, _FEWEST_FELT = 0.2, 20
"""Throttle below which armed motors idle (0.15 in old firmware); records of what is felt until then, at least."""
_MOVES_MS, _AROUND_S = 3.0, 10.0
"""Faster, it taxies or flies; so long before and after belongs to it."""
_DRIVES = frozenset((*MOTORS.values(), THROTTLE, LEFT, RIGHT))
_LEAST_PWM, _WORKS_PWM = 1000.0, 150.0
"""Microseconds; so far above the least of an output is more than idling (MOT_SPIN_ARM 0.1 of 1000)."""
_BY_ITSELF = frozenset(("mission", "return", "guided"))
_WOULD_ARM = 0x10000000
"""MAV_SYS_STATUS_PREARM_CHECK, which ArduPilot sends since 4.0."""
_PLACED = re.compile(r"is using (GPS|external nav|optical flow|range beacons)")
_STARTS_S = 10.0
"""An estimator that starts finds its place so soon; who waits longer for it may have been denied a start meanwhile."""
_UNPLACED = re.compile(r"position estimate|3D fix|waiting for home|no position", re.IGNORECASE)


class ArmChange(NamedTuple):
    """An arming or disarming."""

    time_s: float
    is_armed: bool
    how: str = ""
    """By what or whom, where the record says so."""
    is_forced: bool | None = None
    """None where the log does not say."""
    read_s: float = math.nan
    """The time with which its record is read, where that is not its own; not a number where it is."""


class Armed(Recorded):
    """When the vehicle was armed, and its height and throttle."""

    @cached_property
    def arm_changes(self) -> tuple[ArmChange, ...]:
        """When it was armed and disarmed by its records, and by its texts where these tell of none."""
        table = self.one("ARM", "ArmState")
        if table is not None:
            recorded = [_arm_change(table, row) for row in range(len(table))]
        else:
            by_number = ((_EV_ARMED, True), (_EV_DISARMED, False))
            recorded = [
                ArmChange(self._opened_at(t), is_armed, read_s=t) if is_armed else ArmChange(t, is_armed)
                for number, is_armed in by_number
                for t in self.events(number)
            ]
        recorded.sort(key=lambda change: change[:2])
        spoken = unrecorded_changes([change[:2] for change in recorded], self.messages)
        return tuple(sorted((*recorded, *(ArmChange(*change) for change in spoken)), key=lambda change: change[:2]))

    @cached_property
    def armed(self) -> tuple[Span, ...]:
        """Spans armed. A log that tells of no arming was armed as its status says (STAT of Plane), else all along where
        it is written while armed only; a plane that needs no arming, while it moves; else where its throttle is up."""
        if self.arm_changes:
            return self.recorded_armed
        status = self.one("STAT", "Armed")
        if status is not None:
            return tuple(runs(status.t, status["Armed"] > 0, gap_s=_CLOSED_S))
        if self.is_winged and self.setting("ARMING_REQUIRE") == 0:
            return self._moving()
        return ((0.0, self.end_s),) if self.is_written_armed else self._driven()

    @cached_property
    def recorded_armed(self) -> tuple[Span, ...]:
        """Spans armed by the records of arming. A log whose first word is a disarming was armed from its start. What is
        armed once more was disarmed between, as far as nothing is recorded before: the logger was closed."""
        spans: list[Span] = []
        first = self.arm_changes[0] if self.arm_changes else None
        start = self._armed_unseen(first.time_s) if first is not None and not first.is_armed else None
        for change in self.arm_changes:
            if start is not None:
                spans.append((start, self._recorded_before(change.time_s) if change.is_armed else change.time_s))
            start = change.time_s if change.is_armed else None
        if start is not None:
            spans.append((start, self.end_s))
        return tuple(span for span in spans if span[1] > span[0])

    def _armed_unseen(self, disarmed_s: float) -> float:
        """When a vehicle was armed whose first word is a disarming: before the log, or, where arming was refused first,
        as the logger was opened again."""
        refused_s = max((one.time_s for one in self.refusals if one.time_s < disarmed_s), default=None)
        table = self.one("ATT", "Roll")
        if refused_s is None or table is None:
            return 0.0
        t = table.t[(table.t >= refused_s) & (table.t <= disarmed_s)]
        silent = np.flatnonzero(np.diff(t) > _CLOSED_S)
        return float(t[silent[-1] + 1]) if len(silent) else 0.0

    def _opened_at(self, t: float) -> float:
        """When an arming was recorded that opened the logger: firmware before 3.4 gives the record no time of its own,
        so it is read with that of the last one before, however long the logger had been closed."""
        table = self.one("ATT", "Roll")
        if table is None or len(table) < _FEWEST:
            return t
        place = int(np.searchsorted(table.t, t, "right"))
        silent = float(table.t[place]) - t if place < len(table) else 0.0
        return float(table.t[place]) - _OPENED_S if silent > max(_CLOSED_S, _TIMES * median(np.diff(table.t))) else t

    def _recorded_before(self, t: float) -> float:
        """The last record of the attitude before the logger was opened at a time; that time where it was open."""
        table = self.one("ATT", "Roll")
        before = table.t[table.t < t - _OPENED_S] if table is not None else np.empty(0)
        return t if not len(before) or t - float(before[-1]) < _CLOSED_S else float(before[-1])

    @cached_property
    def is_written_armed(self) -> bool:
        """Whether the log is one that is written while armed only: LOG_DISARMED is 0, no refused arming kept it open
        (AP_Logger: log_while_disarmed), and its motors work."""
        is_only = not self.is_telemetry and self.setting("LOG_DISARMED") == 0 and not self.refusals
        return is_only and (bool(self._driven()) or self._motors_work)

    @property
    def _motors_work(self) -> bool:
        """Whether an output that drives a motor ever left its least."""
        table = self.one("RCOU", "C1")
        outputs = [n for n in range(1, 15) if self.setting(f"SERVO{n}_FUNCTION") in _DRIVES] if table else []
        return table is not None and any(
            f"C{n}" in table.columns
            and np.nanmax(table[f"C{n}"]) > (self.setting(f"SERVO{n}_MIN") or _LEAST_PWM) + _WORKS_PWM
            for n in outputs
        )

    def _moving(self) -> tuple[Span, ...]:
        """From a little before it first moves to a little after it last does; none where no receiver tells."""
        moved = self.one("GPS", "Spd", "Status")
        t = np.empty(0) if moved is None else moved.t[(moved["Spd"] > _MOVES_MS) & (moved["Status"] >= FIX)]
        span = () if not len(t) else ((max(0.0, float(t[0]) - _AROUND_S), min(self.end_s, float(t[-1]) + _AROUND_S)),)
        return span if span and span[0][1] - span[0][0] > 2 * _AROUND_S else ()

    def _driven(self) -> tuple[Span, ...]:
        throttle = self.throttle
        if throttle is None:
            return ()
        up = np.flatnonzero(throttle[1] > 0.05)
        return ((float(throttle[0][up[0]]), float(throttle[0][up[-1]])),) if len(up) else ()

    @cached_property
    def was_refused(self) -> bool:
        """Whether it never armed though that was asked for."""
        return not self.armed and bool(self.lasting_refusals)

    @cached_property
    def lasting_refusals(self) -> tuple[Refusal, ...]:
        """The refusals without complaints that passed before anybody tried to arm: its word that it would arm came
        after them and stayed to the end, or its estimator found its place after it missed that."""
        if self.armed or any(one.was_tried for one in self.refusals):
            return self.refusals
        placed_s = max((t for t, text in self.messages if _PLACED.search(text)), default=-math.inf)
        ready_s = self._would_arm_s
        return tuple(
            one
            for one in self.refusals
            if one.time_s > ready_s and not (0 < placed_s - one.time_s < _STARTS_S and _UNPLACED.search(one.why))
        )

    @property
    def _would_arm_s(self) -> float:
        """When its checks before arming had passed for good, as telemetry tells; before the log where it does not."""
        table = self.one("SYS_STATUS", *READS["SYS_STATUS"])
        if table is None or not len(table):
            return -math.inf
        enabled, healthy = (table[name].astype(np.int64) & _WOULD_ARM > 0 for name in READS["SYS_STATUS"])
        passes = enabled & healthy
        if not passes[-1]:
            return -math.inf
        failed = np.flatnonzero(~passes)
        return float(table.t[failed[-1] + 1]) if len(failed) else -math.inf

    def drives_itself(self, t: Floats) -> Bools:
        """Which of these times lie in an armed span and a mode of a rover that drives without a pilot."""
        automatic = [mode.number for mode in self.modes if mode.number is not None and mode.way in _BY_ITSELF]
        return np.asarray(during(self.armed, t) & np.isin(self.modes_at(t), automatic))

    @property
    def throttle(self) -> tuple[Floats, Floats] | None:
        """Time and throttle out (0 to 1) of the motors together. Read each time: of a large log not all is held."""
        table = self.one("CTUN", "ThO")
        return None if table is None else (table.t, table["ThO"])

    @property
    def height(self) -> tuple[Floats, Floats] | None:
        """Time and height (m) above where it was armed, as estimated by the vehicle; by its barometer where that tells
        that it never left the ground and the estimate alone runs away, or where the accelerometers carried it off."""
        return self.barometer if self._is_runaway or self._is_carried_off else self.estimated_height

    @property
    def estimated_height(self) -> tuple[Floats, Floats] | None:
        """Time and height (m) above where it was armed, as estimated by the vehicle, else by its barometer."""
        return self._above(self._estimate)

    @property
    def controlled_height(self) -> tuple[Floats, Floats] | None:
        """Time and height (m) above where it was armed, as its height controller has it."""
        return self._above(self._first_height(("CTUN", "Alt")))

    @property
    def barometer(self) -> tuple[Floats, Floats] | None:
        """Time and height (m) above where it was armed, by the barometer."""
        return self._above(self._first_height(("CTUN", "BAlt"), ("BARO", "Alt")))

    @cached_property
    def _estimate(self) -> tuple[Table, str] | None:
        places = [(name, field) for name, fields in _ESTIMATES.items() for field in fields]
        recorded = self.tables(_ESTIMATES)
        is_dead = any(name in recorded and field in recorded[name].columns for name, field in places)
        return self._first_height(*places) or (None if is_dead else self._first_height(("BARO", "Alt")))

    def _first_height(self, *places: tuple[str, str]) -> tuple[Table, str] | None:
        """The first of these messages and fields that moves."""
        told = ((self.one(name, column), column) for name, column in places)
        return next(
            ((table, column) for table, column in told if table and len(table) > 1 and np.ptp(table[column]) > 0), None
        )

    def _above(self, known: tuple[Table, str] | None) -> tuple[Floats, Floats] | None:
        """Time and height above what is told where it was armed; of the height above home, where that is near."""
        if known is None:
            return None
        table, column = known
        start = self.armed[0][0] if self.armed else 0.0
        before = table[column][table.t <= start + 1.0]
        zero = float(median(before[-20:])) if len(before) else float(table[column][0])
        if column == "RelHomeAlt":
            zero += _step_at(table.t, table[column], start)  # home was set to where it is as it was armed
        return table.t, table[column] - (zero if abs(zero) < _NEAR_HOME_M or column != "RelHomeAlt" else 0.0)

    @cached_property
    def _is_runaway(self) -> bool:
        """Whether the barometer of a copter, which lives, stays where it was armed while the estimate leaves it, and no
        receiver tells of a climb."""
        heard, estimate = self.barometer, self.estimated_height
        if not self.is_copter or heard is None or estimate is None or not self.armed:
            return False
        armed = during(self.armed, heard[0])
        t, baro = heard[0][armed], heard[1][armed]
        if len(baro) < _FEWEST or not _ALIVE_M < np.ptp(baro) < _ON_GROUND_M:
            return False
        apart = float(np.max(np.abs(np.interp(t, *estimate) - baro)))
        received = self.one("GPS", "Alt", "Status")
        fixed = np.empty(0) if received is None else received["Alt"][received["Status"] >= FIX]
        return apart > _APART_M and (len(fixed) == 0 or float(np.ptp(fixed)) < _APART_M)

    @cached_property
    def _is_carried_off(self) -> bool:
        """Whether accelerometers that do not feel gravity at rest carried a copter's estimate far off its barometer."""
        heard, estimate = self.barometer, self.estimated_height
        if not self.is_copter or heard is None or estimate is None or not self.armed:
            return False
        armed = during(self.armed, heard[0])
        t, baro = heard[0][armed], heard[1][armed]
        if len(baro) < _FEWEST or np.max(np.abs(np.interp(t, *estimate) - baro)) < _CARRIED_OFF_M:
            return False
        felt = self.felt_at_rest
        return bool(felt) and abs(felt[0] - GRAVITY) > _NO_GRAVITY

    @cached_property
    def felt_at_rest(self) -> tuple[float, ...]:
        """What each sensor's accelerometers feel before the throttle is raised, m/s^2, the first one's first; none
        where too little of that is recorded of it."""
        driven, first = self.throttle, self.one("IMU", *_AXES)
        if driven is None or first is None:
            return ()
        lifted = driven[0][driven[1] > _REST]
        until = lifted[0] if len(lifted) else np.inf
        felt = [_felt(table.where(table.t < until)) for table in (first, *self.all("IMU", *_AXES)[1:])]
        return () if felt[0] is None else tuple(one for one in felt if one is not None)


def _felt(standing: Table) -> float | None:
    if len(standing) < _FEWEST_FELT:
        return None
    return float(median(np.sqrt(sum(standing[axis] ** 2 for axis in _AXES))))


def _arm_change(table: Table, row: int) -> ArmChange:
    how = method_words(int(table["Method"][row])) if "Method" in table.columns else ""
    is_forced = bool(table["Forced"][row] == 1) if "Forced" in table.columns else None
    return ArmChange(float(table.t[row]), bool(table["ArmState"][row] > 0), how, is_forced)


def _step_at(t: Floats, height: Floats, armed_s: float) -> float:
    """By how much a height leaps from one record to the next as a vehicle is armed; 0 where it does not, or where the
    log begins then."""
    near = np.flatnonzero((t > max(armed_s - 1.0, float(t[0]) + _SPOOLS_S)) & (t <= armed_s + _SPOOLS_S))
    steps = height[near] - height[near - 1] if len(near) else np.zeros(1)
    most = float(steps[np.argmax(np.abs(steps))])
    return most if abs(most) > _NO_CLIMB_M else 0.0

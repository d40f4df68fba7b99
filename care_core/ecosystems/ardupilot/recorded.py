"""What the log of an ArduPilot vehicle says, under the names and in the units of today's firmware.

The first layer of the run model: instances of messages, parameters, texts, refusals, records of errors and events, and
modes. Nothing is read before it is asked for, and nothing twice.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np

from care_core.ecosystems.ardupilot import held_missions
from care_core.ecosystems.ardupilot.held_missions import HeldMission
from care_core.ecosystems.ardupilot.instances import instances, sees_nothing
from care_core.ecosystems.ardupilot.messages import MESSAGES, expanded, recorded_as
from care_core.ecosystems.ardupilot.texts import Refusal, code_of, in_full, refusal_of
from care_core.ecosystems.base import RunModel
from care_core.ecosystems.plausible import sound as without_nonsense
from care_core.ecosystems.vehicles import Kind, Vehicle, Way, is_simulated, mode_name, mode_number, vehicle_of, way_of
from care_core.ecosystems.vehicles.errors import LEAK
from care_core.ecosystems.vehicles.modes import px4_mode
from care_core.logs import formats
from care_core.logs.base import Log, Table, Wanted
from care_core.run import Setting

READS: Wanted = {
    "MSG": ("Message",),
    "MODE": ("ModeNum", "Rsn"),
    "ERR": ("Subsys", "ECode"),
    "EV": ("Id",),
    **held_missions.READS,
}

_MODES = 2.0**32
_SAME = 1e-5
"""A parameter is stored in 32 bits, its default written in decimals."""
_SILENT_S = 10.0
"""A vehicle beats once a second: ten beats in a row are lost by no slow link."""
_REASONS_KNOWN = (4, 0)
"""Since Copter 4.0 MODE.Rsn means the same on every vehicle (AP_Vehicle/ModeReason.h)."""


class Mode(NamedTuple):
    """A mode, from when it was entered."""

    start_s: float
    number: int | None
    """None where the log gives a name that no mode of the vehicle has."""
    name: str
    way: Way
    reason: int | None
    """Why it was entered (ModeReason.h), None where the log does not say."""


class ErrorRecord(NamedTuple):
    """A code of a subsystem (LogErrorSubsystem, LogErrorCode of AP_Logger.h)."""

    time_s: float
    subsystem: int
    code: int


class Recorded(RunModel):
    """One log. Times are seconds since its start; what it does not hold is None or empty."""

    reads: ClassVar[Wanted] = READS
    """Fields that are read of a message together with any other, by today's names."""

    def __init__(self, log: Log) -> None:
        super().__init__(log)
        self._sound: dict[str, tuple[Table, Table | None]] = {}
        self._instances: dict[str, tuple[list[Table], tuple[Table, ...]]] = {}

    # --- messages ----------------------------------------------------------------------------------------------

    def sound(self, plan: Wanted) -> dict[str, Table]:
        """The channels and fields of a plan as recorded, without dead sources and rows that cannot be."""
        kept = {name: self.sound_table(name, table) for name, table in self.tables(plan).items()}
        return {name: table for name, table in kept.items() if table is not None}

    def all(self, name: str, *fields: str) -> tuple[Table, ...]:
        """The instances of a message that have these fields, by today's names."""
        self.tables(expanded({name: (*fields, *self.reads.get(name, ()))}))
        names = [message for message in recorded_as(name) if message in self._tables]
        recorded = [self._tables[message] for message in names]
        known = self._instances.get(name)
        if known is None or list(map(id, known[0])) != list(map(id, recorded)):  # not yet, or with fewer fields
            kept = {message: self.sound_table(message, self._tables[message]) for message in names}
            sound = {message: table for message, table in kept.items() if table is not None}
            known = self._instances[name] = recorded, instances(sound, name)
        return tuple(table for table in known[1] if len(table) and all(field in table.columns for field in fields))

    def one(self, name: str, *fields: str) -> Table | None:
        """The first instance of a message, None where the log lacks it or one of these fields; of several receivers
        the first that ever sees a satellite."""
        tables = self.all(name, *fields)
        if name == "GPS" and len(tables) > 1:
            tables = (*(table for table in tables if not sees_nothing(table)), *tables)
        return next(iter(tables), None)

    def sound_table(self, name: str, table: Table) -> Table | None:
        """A recorded table without the rows that cannot be; None where its source is dead."""
        known = self._sound.get(name)
        if known is None or known[0] is not table:
            known = self._sound[name] = table, without_nonsense(MESSAGES, name, table)
        return known[1]

    # --- the log and its vehicle -------------------------------------------------------------------------------

    @cached_property
    def end_s(self) -> float:
        """When the log ends; of telemetry, when the vehicle was heard last, where its station recorded on."""
        return self.log.duration_s - self.silent_s

    @cached_property
    def silent_s(self) -> float:
        """How long at its end telemetry holds nothing of the vehicle; 0 for what a slow link may take."""
        beats = self.one("STAT", "State") if self.is_telemetry else None
        silent = 0.0 if beats is None or not len(beats) else self.log.duration_s - float(beats.t[-1])
        return silent if silent > _SILENT_S else 0.0

    @property
    def is_telemetry(self) -> bool:
        """Whether a ground station heard it: then holes are the link's."""
        return self.log.format is formats.MAVLINK_TLOG

    @property
    def clock_jumps(self) -> bool:
        """Whether its clock jumps inside it: two logs in one, or damage; what lies between two records is unknown."""
        return any(one.is_jump for one in self.log.damage)

    @cached_property
    def settings(self) -> Mapping[str, tuple[Setting, ...]]:
        """Per parameter its values as driven, in order of time."""
        return self.log.settings()

    def setting(self, *names: str) -> float | None:
        """The value of a parameter as first driven, by the first of its names that the log holds."""
        for name in names:
            values = self.settings.get(name)
            if values and isinstance(values[0].value, (int, float)) and math.isfinite(values[0].value):
                return float(values[0].value)
        return None

    def default_left(self, name: str) -> float | None:
        """The default of a parameter that was driven off it; None where it is at its default, or the log has none."""
        default = self.settings[name][0].default if self.settings.get(name) else None
        value = self.setting(name)
        if value is None or not isinstance(default, (int, float)) or math.isclose(value, default, rel_tol=_SAME):
            return None
        return float(default)

    @cached_property
    def kind(self) -> Kind:
        """What kind of vehicle the log says that it is of."""
        return vehicle_of(self.log.facts, self.settings).kind

    @property
    def mode_kind(self) -> Kind:
        """Whose numbers modes are told by: a copter's where the log does not say, whose profile reads it."""
        return "copter" if self.kind == "unknown" else self.kind

    @cached_property
    def vehicle(self) -> Vehicle:
        """What the log says that it is."""
        return vehicle_of(self.log.facts, self.settings, self.motor_outputs)

    @cached_property
    def motor_outputs(self) -> int | None:
        """How many motor outputs the log records, where it names them so (firmware before 3.2)."""
        motors = self.sound(expanded({"RCOU": tuple(f"C{n}" for n in range(1, 15))})).get("MOT")
        return None if motors is None else sum(name.startswith("Mot") for name in motors.columns)

    @property
    def is_simulated(self) -> bool:
        """Whether ArduPilot's simulator wrote the log."""
        return is_simulated(self.log.facts, self.settings)

    @property
    def is_copter(self) -> bool:
        """Whether rotors alone lift it; a log that does not say is told by what only copters have."""
        return self.kind in ("copter", "heli") or (self.kind == "unknown" and "MOT_THST_HOVER" in self.settings)

    @property
    def is_winged(self) -> bool:
        """Whether it flies by a wing, a QuadPlane with lift motors beside."""
        return self.kind in ("plane", "quadplane")

    # --- what it said ------------------------------------------------------------------------------------------

    @cached_property
    def messages(self) -> tuple[tuple[float, str], ...]:
        """The vehicle's texts with their times."""
        table = self.one("MSG", "Message")
        return () if table is None else tuple(zip(table.t.tolist(), map(str, table["Message"].tolist()), strict=True))

    def messages_between(self, start_s: float, end_s: float) -> list[tuple[float, str]]:
        """The texts of a span of time."""
        return [(t, text) for t, text in self.messages if start_s <= t <= end_s]

    @cached_property
    def refusals(self) -> tuple[Refusal, ...]:
        """Every time that the firmware said why it cannot be armed."""
        said = (refusal_of(t, text) for t, text in self.messages)
        return in_full([refusal for refusal in said if refusal is not None])

    @cached_property
    def error_records(self) -> tuple[ErrorRecord, ...]:
        """The ERR records, but for a leak that no detector can have told of: the firmware says so as it starts."""
        table = self.one("ERR", "Subsys", "ECode")
        if table is None:
            return ()
        known = table.where(np.isfinite(table["Subsys"]) & np.isfinite(table["ECode"]))
        columns = (known["Subsys"].astype(int).tolist(), known["ECode"].astype(int).tolist())
        records = map(ErrorRecord, known.t.tolist(), *columns)
        pins = [self.setting(f"LEAK{number}_PIN") for number in (1, 2, 3)]
        known_pins = [pin for pin in pins if pin is not None]
        has_detector = not known_pins or max(known_pins) >= 0
        return tuple(one for one in records if has_detector or one.subsystem != LEAK)

    def errors(self, subsystem: int) -> list[tuple[float, int]]:
        """Times and codes of the ERR records of a subsystem, in telemetry of the texts that say the same."""
        if self.is_telemetry:
            return [(t, code) for t, text in self.messages if (code := code_of(text, subsystem)) is not None]
        return [(one.time_s, one.code) for one in self.error_records if one.subsystem == subsystem]

    @cached_property
    def event_records(self) -> tuple[tuple[float, int], ...]:
        """Times and numbers of the EV records."""
        table = self.one("EV", "Id")
        if table is None:
            return ()
        known = table.where(np.isfinite(table["Id"]))
        return tuple(zip(known.t.tolist(), known["Id"].astype(int).tolist(), strict=True))

    def events(self, *ids: int) -> list[float]:
        """Times of the EV records with one of these numbers."""
        return [t for t, number in self.event_records if number in ids]

    @cached_property
    def held_missions(self) -> tuple[HeldMission, ...]:
        """The missions that the vehicle held, in order."""
        return held_missions.held_missions(self.one("CMD", *held_missions.NEEDED))

    # --- modes -------------------------------------------------------------------------------------------------

    @cached_property
    def modes(self) -> tuple[Mode, ...]:
        """The modes in the order in which they were entered; numbers mean what this vehicle means by them."""
        table = self.one("MODE", "ModeNum")
        if table is None:
            return ()
        are_reasons = "Rsn" in table.columns and (self.vehicle_version or (0,)) >= _REASONS_KNOWN
        reasons = table["Rsn"].tolist() if are_reasons else [math.nan] * len(table)
        entered = zip(table.t.tolist(), table["ModeNum"].tolist(), reasons, strict=True)
        return tuple(self._mode(t, mode, reason) for t, mode, reason in entered if _can_be(mode))

    def _mode(self, t: float, mode: float | str, reason: float) -> Mode:
        kind = self.mode_kind
        if isinstance(mode, str):
            number = mode_number(kind, mode)
            name = mode if number is None else mode_name(kind, number)
        else:
            number = px4_mode(int(mode)) if kind == "px4" else int(mode)
            name = mode_name(kind, number)
        way: Way = "other" if number is None else way_of(kind, number)
        return Mode(t, number, name, way, int(reason) if math.isfinite(reason) else None)

    @cached_property
    def vehicle_version(self) -> tuple[int, ...] | None:
        """Version of the firmware, None where the log does not say."""
        return vehicle_of(self.log.facts, self.settings).version

    def mode_at(self, t: float) -> Mode | None:
        """The mode at a time, None where the log does not say."""
        before = [mode for mode in self.modes if mode.start_s <= t]
        return before[-1] if before else None

    def modes_between(self, start_s: float, end_s: float) -> tuple[Mode, ...]:
        """Every mode in force at any time of a span, in order."""
        ends = (*(mode.start_s for mode in self.modes[1:]), math.inf)
        lasting = zip(self.modes, ends, strict=False)  # of no modes there is one end too many
        return tuple(mode for mode, until in lasting if mode.start_s <= end_s and until > start_s)

    def modes_at(self, t: np.ndarray) -> np.ndarray:
        """The number of the mode at each of these times, `UNKNOWN_MODE` where the log does not say."""
        numbers = (UNKNOWN_MODE if mode.number is None else mode.number for mode in self.modes)
        codes = np.array([UNKNOWN_MODE, *numbers], dtype=np.int64)
        return np.asarray(codes[np.searchsorted([mode.start_s for mode in self.modes], t, side="right")])


def _can_be(mode: float | str) -> bool:
    """Whether a mode is a name, or a number of 32 bits as it is sent (custom_mode)."""
    return isinstance(mode, str) or abs(mode) < _MODES


UNKNOWN_MODE = -1
"""The mode where the log does not say."""

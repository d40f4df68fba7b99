"""MAVLink telemetry logs (.tlog): what a ground station heard, and what it said.

Messages of the vehicle's autopilot have the message's own name as channel. Everybody else's (ground station, camera,
radio, another vehicle) is `NAME@SYSTEM.COMPONENT`, so that no sender passes for another.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from datetime import datetime, timezone
from functools import cached_property
from io import BytesIO
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np

from care_core.errors import LogError
from care_core.logs import formats, shared_id
from care_core.logs.ardupilot import Built, facts_of, history, shortest
from care_core.logs.base import Channel, Table, Wanted
from care_core.logs.clock import OwnClock, find_clock, vehicle_time
from care_core.logs.damage import summarised
from care_core.logs.file_windows import FileArray
from care_core.logs.formats import is_raw_mavlink
from care_core.logs.mavlink_packets import (
    STAMP_BYTES,
    V1,
    V2,
    Message,
    Offsets,
    Packets,
    boot_clock,
    decode,
    definitions,
    find_packets,
    frames,
    stamped,
    stamps,
    wanted_extras,
)
from care_core.numbers import Floats
from care_core.run import Damage, Setting

_HEARTBEAT = 0
_TYPE_GCS, _AUTOPILOT_NONE, _AUTOPILOT_ARDUPILOT, _AUTOPILOT_PX4 = 6, 8, 3, 12
_STATION_COMPONENT = 190
"""MAVProxy writes the parameters that it fetched as a file into its log as if this component had sent them."""
_PARAM_INTEGERS = {1: "u1", 2: "i1", 3: "<u2", 4: "<i2", 5: "<u4", 6: "<i4"}
_HEAD_BYTES = 4096
_PROOF = 3
"""Packets of a message without a known definition that must agree on it."""
_EARLIEST_S = datetime(2005, 1, 1, tzinfo=timezone.utc).timestamp()

# MAV_TYPE -> what flies, and the name of ArduPilot's firmware for it.
_COPTER = ("multicopter", "ArduCopter")
_PLANE = ("fixed wing", "ArduPlane")
_VEHICLES: dict[int, tuple[str, str]] = {
    1: _PLANE, 2: _COPTER, 3: _COPTER, 4: ("helicopter", "ArduCopter"), 10: ("rover", "ArduRover"),
    11: ("boat", "ArduRover"), 12: ("submarine", "ArduSub"), 13: _COPTER, 14: _COPTER, 15: _COPTER,
    19: ("VTOL", "ArduPlane"), 20: ("VTOL", "ArduPlane"), 21: ("VTOL", "ArduPlane"), 22: ("VTOL", "ArduPlane"),
    29: _COPTER, 35: _COPTER,
}  # fmt: skip


class Sender(NamedTuple):
    """Who sent a packet."""

    system: int
    component: int


class MavlinkLog:
    """A telemetry log, seen from its vehicle: the system whose autopilot sent most messages. Times are when the
    ground station received a packet, in seconds from its first; where its clock goes wrong against the vehicle's own
    time, they are that.

    Raises:
        LogError: the file cannot be read, or holds no packet.
    """

    format = formats.MAVLINK_TLOG

    def __init__(self, path: Path) -> None:
        self.path = path
        data = FileArray.open(path)
        restamped = _restamped(data, path)
        self._is_restamped = restamped is not None
        self._data = data = data if restamped is None else restamped
        packets = find_packets(data)
        if not len(packets):
            raise LogError("The log holds no sound MAVLink packet.", hint="Copy it again.", where=str(path))
        seconds = stamps(data, packets.start)
        rows, own = boot_clock(data, packets)
        said = OwnClock(packets.start[rows], own, seconds[rows])
        self._clock, impossible, jumps = find_clock(seconds, packets.start, said)
        self._first_stamp_s = float(seconds[~impossible][0])
        self._own_time = vehicle_time(said, self._clock)
        if self._own_time is not None:  # then no stamp counts
            impossible, jumps = np.zeros_like(impossible), []
        self.duration_s = (self._own_time or self._clock).duration_s
        lost = [Damage("a packet's time is impossible", byte) for byte in packets.start[impossible].tolist()]
        unknown, broken = self._between(data, packets)
        kept = packets.where(~impossible)
        self._senders = self._rank(data, kept)
        self.vehicle = self._senders[0]
        self._starts = _by_channel(kept, self.vehicle)
        self._unknown = {f"UNKNOWN {name}": found for name, found in _by_channel(unknown, self.vehicle).items()}
        self.damage = (
            *summarised(jumps, "clock jumps"),
            *summarised(lost, "packets with an impossible time"),
            *summarised(broken, "damaged places"),
        )

    def channels(self) -> tuple[Channel, ...]:
        data = self._data
        found = []
        for name, (_, start) in sorted(chain(self._starts.items(), self._unknown.items())):
            t = self._times(data, start)
            kind = "MAVLink" if name in self._starts else "MAVLink of another definition"
            found.append(Channel.over(name, kind, len(t), float(t[-1] - t[0])))
        return tuple(found)

    def read(self, wanted: Wanted) -> Mapping[str, Table]:
        data = self._data
        tables = {}
        for name, fields in wanted.items():
            if name in self._starts:
                message, start = self._starts[name]
                columns = {field: decode(data, start, message.fields[field]) for field in fields
                           if field in message.fields}  # fmt: skip
                tables[name] = Table(self._times(data, start), columns)
        return tables

    def settings(self) -> Mapping[str, tuple[Setting, ...]]:
        return self._settings

    @cached_property
    def _settings(self) -> Mapping[str, tuple[Setting, ...]]:
        """What the vehicle said its parameters are. A PARAM_SET is only a wish: no proof that it was obeyed."""
        names = ("PARAM_VALUE", f"PARAM_VALUE@{self.vehicle.system}.{_STATION_COMPONENT}")
        tables = self.read(dict.fromkeys(names, ("param_id", "param_value", "param_type")))
        as_bytes = self._autopilot == _AUTOPILOT_PX4 or any(map(_has_bytes, tables.values()))
        rows = sorted(chain.from_iterable(_parameters(table, as_bytes=as_bytes) for table in tables.values()))
        return history(((t, name, value, None) for t, name, value in rows if name), "PARAM_VALUE")

    @cached_property
    def facts(self) -> Mapping[str, str]:
        """`firmware`, `frame` and `vehicle` where the log tells them, `system` of the vehicle, `others` heard."""
        tables = self.read({
            "STATUSTEXT": ("text",), "AUTOPILOT_VERSION": ("flight_sw_version", "flight_custom_version")
        })  # fmt: skip
        vehicle, firmware = _VEHICLES.get(self._kind, ("", ""))
        is_ardupilot = firmware and self._autopilot == _AUTOPILOT_ARDUPILOT
        name = f"{firmware} {_version(tables.get('AUTOPILOT_VERSION'))}".strip() if is_ardupilot else ""
        texts = tables["STATUSTEXT"]["text"].tolist() if "STATUSTEXT" in tables else ()
        facts = facts_of(texts, Built(vehicle, name))
        if self._autopilot == _AUTOPILOT_PX4:
            facts["stack"] = "PX4"
        if self._is_restamped:
            facts["clock"] = "seconds since the vehicle was started, as its messages say"
        elif self._own_time is not None:
            facts["clock"] = str(self._own_time)
        facts["system"] = f"{self.vehicle.system}.{self.vehicle.component}"
        others = [sender for sender in self._senders[1:] if sender.system != self.vehicle.system]
        if others:
            facts["others"] = ", ".join(self._called(sender) for sender in others)
        if vehicles := [self._called(sender) for sender in others if self._is_vehicle(sender)]:
            facts["vehicles"] = ", ".join(vehicles)
        if why := shared_id.sharing(self.read(shared_id.READS)):
            facts["shared id"] = why
        return facts

    def _is_vehicle(self, who: Sender) -> bool:
        """Whether it is an autopilot that drives or flies something: no station, camera, tracker or transponder."""
        kind, autopilot = self._said.get(who, (-1, -1))
        return kind in _VEHICLES and autopilot != _AUTOPILOT_NONE

    @cached_property
    def start(self) -> str | None:
        """When the first packet came (UTC), by the ground station's clock."""
        if not _EARLIEST_S < self._first_stamp_s < 1e11:
            return None
        return datetime.fromtimestamp(self._first_stamp_s, timezone.utc).isoformat(timespec="seconds")

    def _times(self, data: FileArray, start: Offsets) -> Floats:
        """When packets came, or were sent where the station's clock goes wrong."""
        return self._clock.seconds(stamps(data, start), start) if self._own_time is None else self._own_time.at(start)

    def _rank(self, data: FileArray, packets: Packets) -> tuple[Sender, ...]:
        """Everybody heard, the vehicle's autopilot first, then by number of messages.

        An autopilot says what it is in its heartbeat; where nobody does, whoever is no ground station may be one.
        """
        fields = definitions()[_HEARTBEAT].fields
        beats = packets.where(packets.id == _HEARTBEAT)
        kinds, autopilots = (decode(data, beats.start, fields[name]) for name in ("type", "autopilot"))
        self._said: dict[Sender, tuple[int, int]] = {}
        for who, kind, autopilot in zip(_senders(beats), kinds.tolist(), autopilots.tolist(), strict=True):
            self._said.setdefault(who, (int(kind), int(autopilot)))
        codes, counts = np.unique(packets.system.astype(np.int32) << 8 | packets.component, return_counts=True)
        heard = Counter({Sender(code >> 8, code & 0xFF): count
                         for code, count in zip(codes.tolist(), counts.tolist(), strict=True)})  # fmt: skip
        of_system: Counter[int] = Counter()
        for who, count in heard.items():
            of_system[who.system] += count

        def standing(who: Sender) -> tuple[bool, bool, int, int]:
            kind, autopilot = self._said.get(who, (-1, -1))
            is_autopilot = autopilot not in (-1, _AUTOPILOT_NONE) and kind != _TYPE_GCS
            return is_autopilot, kind != _TYPE_GCS, of_system[who.system], heard[who]

        ranked = tuple(sorted(heard, key=standing, reverse=True))
        self._kind, self._autopilot = self._said.get(ranked[0], (-1, -1))
        return ranked

    def _called(self, who: Sender) -> str:
        kind, autopilot = self._said.get(who, (-1, -1))
        if kind == _TYPE_GCS:
            return f"{who.system}.{who.component} (ground station)"
        if autopilot in (-1, _AUTOPILOT_NONE):
            return f"{who.system}.{who.component}"
        return f"{who.system}.{who.component} ({_VEHICLES.get(kind, ('vehicle', ''))[0]})"

    def _between(self, data: FileArray, packets: Packets) -> tuple[Packets, list[Damage]]:
        """What lies between the sound packets: packets of messages that pymavlink defines not or otherwise, and damage.

        The byte that a message's definition adds to the checksum is one of 256. Where several packets of one number
        and size need the same, that is their definition; broken packets would need a different one each.
        """
        lows, highs = np.append(0, packets.end), np.append(packets.start, len(data))
        open_places = highs > lows
        walked = [_walk(data, low, high) for low, high in
                  zip(lows[open_places].tolist(), highs[open_places].tolist(), strict=True)]  # fmt: skip
        places = np.array([place for framed, _ in walked for place in framed], dtype=np.int64)
        framed = frames(data, places)
        kinds = list(zip(framed.id.tolist(), (framed.end - framed.start).tolist(), wanted_extras(data, framed).tolist(),
                         strict=True))  # fmt: skip
        seen = Counter(kinds)
        is_unknown = np.array([kind[-1] >= 0 and seen[kind] >= _PROOF for kind in kinds], dtype=bool)
        wrong = framed.where(~is_unknown)
        damage = [(low, f"a packet of {high - low} bytes has a wrong checksum")
                  for low, high in zip(wrong.start.tolist(), wrong.end.tolist(), strict=True)]  # fmt: skip
        damage += [(low, f"{high - low} bytes are no packets") for _, rest in walked for low, high in rest]
        times = self._times(data, packets.start)
        before = np.searchsorted(packets.start, [low for low, _ in sorted(damage)]) - 1
        return framed.where(is_unknown), [
            Damage(text, low, float(times[at]) if at >= 0 and 0.0 <= times[at] <= self.duration_s else None)
            for (low, text), at in zip(sorted(damage), before.tolist(), strict=True)
        ]


def _restamped(data: FileArray, path: Path) -> FileArray | None:
    """The packets of a file that has no stamps with those that they carry themselves; None where it has stamps.

    Raises:
        LogError: it has none, and its messages carry none.
    """
    if not is_raw_mavlink(data.between(0, _HEAD_BYTES).tobytes()):
        return None
    found = stamped(data)
    if found is None:
        hint = "Use the .tlog that the ground station wrote beside it."
        raise LogError("This is MAVLink without time stamps, and no message tells a time.", hint=hint, where=str(path))
    return FileArray(BytesIO(found), path)


def _walk(data: FileArray, low: int, high: int) -> tuple[list[int], list[tuple[int, int]]]:
    """Markers of the stamped frames that follow each other from byte `low`, and what is left of `low` to `high`."""
    framed: list[int] = []
    while low < high:
        marker = low + STAMP_BYTES
        if marker + 12 > high or data.byte(low) or data.byte(marker) not in (V1, V2):
            return framed, [(low, high)]
        frame = frames(data, np.array([marker]))
        if not len(frame) or frame.end[0] > high:
            return framed, [(low, high)]
        framed.append(marker)
        low = int(frame.end[0])
    return framed, []


def _by_channel(packets: Packets, vehicle: Sender) -> dict[str, tuple[Message, Offsets]]:
    """Channel name -> its message and where its packets' stamps begin."""
    codes = packets.id.astype(np.int64) << 16 | packets.system.astype(np.int64) << 8 | packets.component
    order = np.argsort(codes, kind="stable")
    values, firsts = np.unique(codes[order], return_index=True)
    parts = np.split(packets.start[order], firsts[1:]) if len(packets) else []
    found = {}
    for code, start in zip(values.tolist(), parts, strict=True):
        number, sender = code >> 16, Sender(code >> 8 & 0xFF, code & 0xFF)
        message = definitions().get(number) or Message(number, str(number), 0, {})
        by = "" if sender == vehicle else f"@{sender.system}.{sender.component}"
        found[f"{message.name}{by}"] = (message, start)
    return found


def _senders(packets: Packets) -> Iterator[Sender]:
    return map(Sender, packets.system.tolist(), packets.component.tolist())


def _has_bytes(table: Table) -> bool:
    """Whether whole numbers have values that no whole number has: the sender put their bytes there."""
    whole = np.isin(table["param_type"], list(_PARAM_INTEGERS))
    size = np.abs(table["param_value"])
    return bool(np.any(whole & (size > 0) & (size < np.finfo(np.float32).tiny)))


def _parameters(table: Table, *, as_bytes: bool) -> Iterable[tuple[float, str, float]]:
    """Time, name and value. PX4 and others put the bytes of whole numbers where ArduPilot writes them as a fraction."""
    for t, name, value, kind in zip(table.t, table["param_id"], table["param_value"], table["param_type"], strict=True):
        code = _PARAM_INTEGERS.get(int(kind)) if as_bytes else None
        if code is not None:
            raw = np.array([value], dtype="<f4").view(np.uint8)
            yield float(t), name, float(raw[: np.dtype(code).itemsize].view(code)[0])
        elif np.isfinite(value) or int(kind) not in _PARAM_INTEGERS:
            yield float(t), name, shortest(value)


def _version(table: Table | None) -> str:
    if table is None or not len(table):
        return ""
    number = int(table["flight_sw_version"][0])
    commit = bytes(int(byte) for byte in table["flight_custom_version"][0]).split(b"\0")[0].decode("ascii", "ignore")
    return f"V{number >> 24}.{number >> 16 & 0xFF}.{number >> 8 & 0xFF}" + (f" ({commit})" if commit else "")

"""A telemetry log as a ground station would have recorded it of the flight in a DataFlash log."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from care_core.logs.base import Table
from care_core.logs.opening import open_log

START_US = 1_700_000_000_000_000
LISTENS_ON_S = 5.0
VEHICLE, STATION = (1, 1), (255, 190)
Sent = tuple[float, tuple[int, int], Any]

_READ = {
    "POS": ("Lat", "Lng", "Alt", "RelHomeAlt"), "ATT": ("Roll", "Pitch", "Yaw", "DesRoll", "DesPitch", "DesYaw"),
    "BAT": ("Volt", "Curr", "EnrgTot"), "RCOU": tuple(f"C{n}" for n in range(1, 5)), "GPS": ("HDop", "NSats"),
    "PSCN": ("VN",), "PSCE": ("VE",), "PSCD": ("VD",), "VIBE": ("VibeX", "VibeY", "VibeZ"), "CTUN": ("ThO",),
    "XKF4": ("SV", "SP", "SH", "SM"), "ARM": ("ArmState",), "MODE": ("ModeNum",), "MSG": ("Message",),
    "CMD": ("CNum", "CId", "Lat", "Lng", "Alt"), "ORGN": ("Type", "Lat", "Lng"),
}  # fmt: skip


def write_tlog(path: Path, source: Path, rng: np.random.Generator, *, loss: float = 0.02, texts: bool = True) -> Path:
    """Write what a ground station hears of the flight in `source`: late by a random delay, some packets lost."""
    senders = {sender: mavlink.MAVLink(None, *sender) for sender in (VEHICLE, STATION, (51, 68))}
    written = []
    for t, sender, message in _sent(source, texts=texts):
        if message.get_type() not in ("PARAM_VALUE", "MISSION_ITEM_INT") and rng.random() < loss:
            continue
        stamp = START_US + int((t + rng.uniform(0.02, 0.15)) * 1e6)
        # The radio's own packets are of the first version, as on many links.
        written.append((stamp, message.pack(senders[sender], force_mavlink1=sender == (51, 68))))
    written.sort(key=lambda one: one[0])
    path.write_bytes(b"".join(struct.pack(">Q", stamp) + packet for stamp, packet in written))
    return path


def _sent(source: Path, *, texts: bool) -> Iterator[Sent]:
    log = open_log(source)
    tables = log.read(_READ)
    for at, history in enumerate(log.settings().values()):
        name, value = history[0].name, float(history[0].value)
        yield at * 0.002, VEHICLE, mavlink.MAVLink_param_value_message(name.encode(), value, 9, len(log.settings()), at)
    yield from _mission(tables["CMD"])
    yield from _streams(tables)
    yield from _once_a_second(tables, log.duration_s)
    homes = tables.get("ORGN")
    rows = zip(homes.t, homes["Type"], homes["Lat"], homes["Lng"], strict=True) if homes is not None else ()
    for t, kind, lat, lng in rows:
        if kind != 1:
            continue
        place = (_e7(lat), _e7(lng), 584_000, 0.0, 0.0, 0.0, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0)
        yield t, VEHICLE, mavlink.MAVLink_home_position_message(*place)
    words = tables["MSG"]
    for t, text in zip(words.t.tolist(), words["Message"].tolist(), strict=True):
        yield from _spoken(t, text, texts=texts)


def _spoken(t: float, text: str, *, texts: bool) -> Iterator[Sent]:
    """A text, in pieces of 50 characters, and the numbers that go with it."""
    word, _, rest = text.partition(" ")
    if word == "Reached":
        yield t, VEHICLE, mavlink.MAVLink_mission_item_reached_message(int(text.rpartition("#")[2]))
    if word == "Mission:":
        yield t, VEHICLE, mavlink.MAVLink_mission_current_message(int(rest.split()[0]))
    if texts or word not in ("Reached", "Mission:"):
        pieces = [text[at : at + 50] for at in range(0, len(text), 50)]
        for number, piece in enumerate(pieces):
            identity = 7 if len(pieces) > 1 else 0
            yield t + number * 0.2, VEHICLE, mavlink.MAVLink_statustext_message(6, piece.encode(), identity, number)


def _mission(items: Table) -> Iterator[Sent]:
    """The upload: the ground station sends the items, to the vehicle."""
    first = items.where(items.t == items.t[0])
    yield 3.0, STATION, mavlink.MAVLink_mission_count_message(1, 1, len(first))
    for number, command, lat, lng, alt in zip(*(first[name].tolist() for name in first.columns), strict=True):
        place = (0.0, 0.0, 0.0, 0.0, _e7(lat), _e7(lng), alt)
        item = mavlink.MAVLink_mission_item_int_message(1, 1, int(number), 3, int(command), 0, 1, *place)
        yield 3.1 + number * 0.1, STATION, item
    yield 4.5, VEHICLE, mavlink.MAVLink_mission_ack_message(255, 190, 0)


def _streams(tables: dict[str, Table] | Any) -> Iterator[Sent]:
    """Position, attitude, battery and health at the rate of the log."""
    position = tables["POS"]

    def at(name: str, field: str, t: float) -> float:
        return float(np.interp(t, tables[name].t, tables[name][field]))

    for row, t in enumerate(position.t.tolist()):
        lat, lng, alt, height = (float(position[name][row]) for name in _READ["POS"])
        north, east, down = (round(at(f"PSC{axis}", f"V{axis}", t) * 100) for axis in "NED")
        here = (_e7(lat), _e7(lng), round(alt * 1e3), round(height * 1e3), north, east, down, 0)
        yield t, VEHICLE, mavlink.MAVLink_global_position_int_message(int(t * 1e3), *here)
        roll, pitch, yaw = (math.radians(at("ATT", name, t)) for name in ("Roll", "Pitch", "Yaw"))
        yield t, VEHICLE, mavlink.MAVLink_attitude_message(int(t * 1e3), roll, pitch, yaw, 0.0, 0.0, 0.0)
        cells = [round(at("BAT", "Volt", t) * 1e3), *[65535] * 9]
        amps, energy = round(at("BAT", "Curr", t) * 100), round(at("BAT", "EnrgTot", t) * 36)
        yield t, VEHICLE, mavlink.MAVLink_battery_status_message(0, 0, 0, 32767, cells, amps, 100, energy, -1)
        health = [at("VIBE", f"Vibe{axis}", t) for axis in "XYZ"]
        yield t, VEHICLE, mavlink.MAVLink_vibration_message(int(t * 1e6), *health, 0, 0, 0)
        motors = [round(at("RCOU", f"C{n}", t)) for n in range(1, 5)]
        yield t, VEHICLE, mavlink.MAVLink_servo_output_raw_message(int(t * 1e6), 0, *motors, 0, 0, 0, 0)
        ratios = [at("XKF4", name, t) for name in ("SV", "SP", "SH", "SM")]
        yield t, VEHICLE, mavlink.MAVLink_ekf_status_report_message(831, *ratios, 0.0)
        throttle = round(at("CTUN", "ThO", t) * 100)
        yield t, VEHICLE, mavlink.MAVLink_vfr_hud_message(0.0, 0.0, 0, throttle, alt, 0.0)


def _once_a_second(tables: Any, duration_s: float) -> Iterator[Sent]:
    """Heartbeats of both ends, the receiver's state and the radio's."""
    armings, modes = tables.get("ARM"), tables["MODE"]
    for t in np.arange(0.5, duration_s + LISTENS_ON_S, 1.0).tolist():
        is_armed = armings is not None and any(armings["ArmState"][armings.t <= t][-1:] == 1)
        mode = int(modes["ModeNum"][modes.t <= t][-1])
        base = 0x51 | (mavlink.MAV_MODE_FLAG_SAFETY_ARMED if is_armed else 0)
        yield t, VEHICLE, mavlink.MAVLink_heartbeat_message(2, 3, base, mode, 4, 3)
        yield t, STATION, mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
        yield t, (51, 68), mavlink.MAVLink_radio_status_message(200, 190, 100, 30, 40, 0, 0)
        hdop = round(float(np.interp(t, tables["GPS"].t, tables["GPS"]["HDop"])) * 100)
        fix = (int(t * 1e6), 3, 0, 0, 0, hdop, 100, 0, 0, 10)
        yield t, VEHICLE, mavlink.MAVLink_gps_raw_int_message(*fix)


def _e7(degrees: float) -> int:
    return round(degrees * 1e7)

"""Telemetry logs: against pymavlink message by message, on packets made here, and on broken files."""

from __future__ import annotations

import math
import os
import struct
from collections import defaultdict
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from care_core.diagnose.judging import read_and_judge
from care_core.ecosystems.examine import examine
from care_core.ecosystems.findings import every_finding
from care_core.ecosystems.registry import run_model
from care_core.errors import LogError
from care_core.logs.file_windows import FileArray
from care_core.logs.mavlink import MavlinkLog
from care_core.logs.mavlink_packets import find_packets
from care_core.logs.opening import open_log
from care_core.logs.shared_id import _turns
from care_core.logs.telemetry import as_dataflash
from care_core.profile.store import load_profile
from tests.groundstation import write_tlog

START_US = 1_700_000_000_000_000
COPTER = (1, 1)


class Station:
    """Writes packets as they come in, a tenth of a second apart."""

    def __init__(self) -> None:
        self.senders: dict[tuple[int, int], Any] = {}
        self.parts: list[bytes] = []

    def hear(self, message: Any, sender: tuple[int, int] = COPTER, *, v1: bool = False) -> Station:
        mav = self.senders.setdefault(sender, mavlink.MAVLink(None, *sender))
        stamp = START_US + 100_000 * len(self.parts)
        self.parts.append(struct.pack(">Q", stamp) + message.pack(mav, force_mavlink1=v1))
        return self

    def write(self, path: Path) -> Path:
        path.write_bytes(b"".join(self.parts))
        return path


def heartbeat(kind: int = 2, autopilot: int = 3, armed: int = 0) -> Any:
    return mavlink.MAVLink_heartbeat_message(kind, autopilot, 0x51 | armed, 5, 4, 3)


def attitude(roll: float) -> Any:
    return mavlink.MAVLink_attitude_message(1000, roll, 0.5, 0.0, 0.0, 0.0, 0.0)


def parameter(name: str, value: float, kind: int = 9) -> Any:
    return mavlink.MAVLink_param_value_message(name.encode(), value, kind, 2, 0)


def flight(count: int = 40) -> Station:
    station = Station().hear(heartbeat())
    for number in range(count):
        station.hear(attitude(number / 8), v1=number % 2 == 0)
    return station


def test_a_text_ends_with_its_last_word(tmp_path: Path) -> None:
    station = flight(4).hear(mavlink.MAVLink_statustext_message(4, b"Failsafe activated\t"))
    texts = as_dataflash(MavlinkLog(station.write(tmp_path / "a.tlog"))).read({"MSG": ("Message",)})["MSG"]
    assert texts["Message"].tolist() == ["Failsafe activated"]


def test_a_rover_that_is_driven_and_stands_is_seen_from_the_ground(tmp_path: Path) -> None:
    station = Station().hear(heartbeat(kind=10, armed=128))
    for number in range(60):
        drives = 0.0 if number > 20 else 1.0
        station.hear(mavlink.MAVLink_heartbeat_message(10, 3, 0x51 | 128, 10, 4, 3))
        station.hear(mavlink.MAVLink_vfr_hud_message(0.0, drives, 0, 100, 0.0, 0.0))
        station.hear(attitude(0.0))
    health = examine(run_model(MavlinkLog(station.write(tmp_path / "a.tlog"))))
    assert "the vehicle is driven and does not move" in [one.title for one in every_finding(health.findings)]


def test_both_versions_and_cut_zeros_are_read(tmp_path: Path) -> None:
    log = MavlinkLog(flight(8).write(tmp_path / "a.tlog"))
    table = log.read({"ATTITUDE": ("roll", "pitch", "yawspeed", "none"), "NONE": ("x",)})["ATTITUDE"]
    np.testing.assert_array_equal(table["roll"], np.arange(8) / 8)
    np.testing.assert_array_equal(table["pitch"], np.full(8, 0.5))
    np.testing.assert_array_equal(table["yawspeed"], np.zeros(8))
    np.testing.assert_allclose(table.t, 0.1 + 0.1 * np.arange(8), atol=1e-6)
    assert set(table.columns) == {"roll", "pitch", "yawspeed"}
    assert (log.damage, log.start) == ((), "2023-11-14T22:13:20+00:00")
    assert log.duration_s == pytest.approx(0.8)


def test_signed_packets_are_read(tmp_path: Path) -> None:
    mav = mavlink.MAVLink(None, 1, 1)
    mav.signing.secret_key, mav.signing.sign_outgoing = b"k" * 32, True
    packets = [heartbeat().pack(mav), attitude(0.25).pack(mav)]
    stamped = b"".join(struct.pack(">Q", START_US + at) + packet for at, packet in enumerate(packets))
    assert packets[0][2] == 1
    (tmp_path / "a.tlog").write_bytes(stamped)
    log = MavlinkLog(tmp_path / "a.tlog")
    assert log.damage == ()
    assert log.read({"ATTITUDE": ("roll",)})["ATTITUDE"]["roll"].tolist() == [0.25]


def test_the_vehicle_is_told_from_the_others(tmp_path: Path) -> None:
    station = flight(30)
    for _ in range(60):
        station.hear(heartbeat(6, 8), (255, 190)).hear(attitude(9.0), (1, 154))
    station.hear(heartbeat(), (7, 1)).hear(attitude(7.0), (7, 1))
    log = MavlinkLog(station.write(tmp_path / "a.tlog"))
    assert (log.facts["system"], log.facts["vehicle"], log.facts["firmware"]) == ("1.1", "multicopter", "ArduCopter")
    assert log.facts["others"] == "7.1 (multicopter), 255.190 (ground station)"
    assert {channel.name: channel.count for channel in log.channels()} == {
        "HEARTBEAT": 1, "ATTITUDE": 30, "ATTITUDE@1.154": 60, "HEARTBEAT@255.190": 60, "HEARTBEAT@7.1": 1,
        "ATTITUDE@7.1": 1,
    }  # fmt: skip
    assert max(log.read({"ATTITUDE": ("roll",)})["ATTITUDE"]["roll"]) < 5


def test_parameters_with_the_time_of_their_changes(tmp_path: Path) -> None:
    station = flight(4).hear(parameter("RTL_ALT", 1500)).hear(parameter("PSC_VELXY_P", 0.135))
    station.hear(mavlink.MAVLink_param_set_message(1, 1, b"PSC_VELXY_P", 9.0, 9), (255, 190))
    station.hear(parameter("RTL_ALT", 1500)).hear(parameter("RTL_ALT", 300)).hear(parameter("RTL_ALT", 1.0), (1, 154))
    found = MavlinkLog(station.write(tmp_path / "a.tlog")).settings()
    assert [(one.value, one.changed_at_s) for one in found["RTL_ALT"]] == [(1500.0, None), (300.0, pytest.approx(0.9))]
    assert [(one.value, one.source) for one in found["PSC_VELXY_P"]] == [(0.135, "PARAM_VALUE")]


def test_px4_sends_whole_numbers_as_their_bytes(tmp_path: Path) -> None:
    (as_float,) = struct.unpack("<f", struct.pack("<i", 42))
    station = Station().hear(heartbeat(autopilot=12)).hear(parameter("COM_RC_LOSS_T", as_float, 6))
    log = MavlinkLog(station.write(tmp_path / "a.tlog"))
    assert log.settings()["COM_RC_LOSS_T"][0].value == 42.0
    assert log.facts["stack"] == "PX4"


@pytest.mark.parametrize(("autopilot", "sent"), [(0, 2**-149), (3, 1.0)])
def test_others_that_do_are_told_by_their_values(tmp_path: Path, autopilot: int, sent: float) -> None:
    station = Station().hear(heartbeat(autopilot=autopilot)).hear(parameter("RCMAP_ROLL", sent, 2))
    station.hear(parameter("RCMAP_GAIN", 0.5, 9))
    settings = MavlinkLog(station.write(tmp_path / "a.tlog")).settings()
    assert (settings["RCMAP_ROLL"][0].value, settings["RCMAP_GAIN"][0].value) == (1.0, 0.5)


def test_noise_between_packets_is_reported_and_skipped(tmp_path: Path) -> None:
    station = flight()
    station.parts.insert(5, b"\xfd\x09noise\xfe" * 7)
    log = MavlinkLog(station.write(tmp_path / "a.tlog"))
    assert len(log.read({"ATTITUDE": ("roll",)})["ATTITUDE"]) == 40
    (found,) = log.damage
    assert (found.what, found.byte) == ("56 bytes are no packets", sum(map(len, station.parts[:5])))
    assert found.time_s == pytest.approx(0.4)


def test_much_damage_is_told_in_two_lines(tmp_path: Path) -> None:
    station = flight(100)
    for at in range(10, 90):
        station.parts[at] = station.parts[at][:20] + bytes([station.parts[at][20] ^ at]) + station.parts[at][21:]
    log = MavlinkLog(station.write(tmp_path / "a.tlog"))
    assert len(log.read({"ATTITUDE": ("roll",)})["ATTITUDE"]) == 20
    assert [one.what.partition(",")[0] for one in log.damage] == [
        "80 damaged places", f"a packet of {len(station.parts[89])} bytes has a wrong checksum"
    ]  # fmt: skip


def test_a_message_of_another_definition_is_no_damage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    station = flight(4)
    with monkeypatch.context() as patch:
        patch.setattr(mavlink.MAVLink_vfr_hud_message, "crc_extra", 77)
        for speed in range(5):
            station.hear(mavlink.MAVLink_vfr_hud_message(speed, 1.0, 2, 3, 4.0, 5.0))
    log = MavlinkLog(station.write(tmp_path / "a.tlog"))
    assert log.damage == ()
    assert ("UNKNOWN VFR_HUD", 5) in [(channel.name, channel.count) for channel in log.channels()]
    assert "VFR_HUD" not in log.read({"VFR_HUD": ("alt",)})


def test_a_packet_of_another_century_is_damage(tmp_path: Path) -> None:
    station = flight()
    station.parts[20] = struct.pack(">Q", START_US + (1 << 52)) + station.parts[20][8:]
    log = MavlinkLog(station.write(tmp_path / "a.tlog"))
    assert log.duration_s == pytest.approx(4.0)
    assert [one.what for one in log.damage] == ["a packet's time is impossible"]
    assert len(log.read({"ATTITUDE": ("roll",)})["ATTITUDE"]) == 39


def test_packets_without_stamps_have_the_time_that_they_carry(tmp_path: Path) -> None:
    station = Station()
    boot_ms = [1000, 1100, 1200, 1150, 1300, 60, 160, 260]  # one is overtaken, and the vehicle starts again
    for number, ms in enumerate(boot_ms):
        station.hear(mavlink.MAVLink_attitude_message(ms, 0.1 * number, 0.5, 0.0, 0.0, 0.0, 0.0)).hear(heartbeat())
    path = tmp_path / "a.tlog.raw"
    path.write_bytes(b"".join(part[8:] for part in station.parts))
    log, stamped = open_log(path), MavlinkLog(station.write(tmp_path / "a.tlog"))
    assert log.facts["clock"] == "seconds since the vehicle was started, as its messages say"
    assert log.start is None
    counts = {channel.name: channel.count for channel in stamped.channels()}
    assert {channel.name: channel.count for channel in log.channels()} == counts
    told = log.read({"ATTITUDE": ("roll",)})["ATTITUDE"]
    np.testing.assert_allclose(told["roll"], 0.1 * np.arange(8), atol=1e-6)
    np.testing.assert_allclose(told.t, [0.0, 0.1, 0.2, 0.2, 0.3, 0.3, 0.4, 0.5], atol=1e-3)
    assert log.damage == ()


def test_what_a_vehicle_prints_as_it_starts_hides_no_packets(tmp_path: Path) -> None:
    station = Station()
    for ms in (1000, 1100, 1200):
        station.hear(mavlink.MAVLink_attitude_message(ms, 0.1, 0.5, 0.0, 0.0, 0.0, 0.0))
    first, *others = [part[8:] for part in station.parts]
    path = tmp_path / "a.tlog.raw"
    path.write_bytes(b"".join((first, b"init()\r\n", *others)))
    assert len(open_log(path).read({"ATTITUDE": ("roll",)})["ATTITUDE"]) == 3


def test_packets_that_carry_no_time_and_have_no_stamp_are_refused_by_name(tmp_path: Path) -> None:
    station = Station()
    for _ in range(9):
        station.hear(mavlink.MAVLink_vfr_hud_message(1.0, 1.0, 2, 3, 4.0, 5.0))
    path = tmp_path / "a.rlog"
    path.write_bytes(b"".join(part[8:] for part in station.parts))
    with pytest.raises(LogError, match="without time stamps") as caught:
        open_log(path)
    assert "tlog" in caught.value.hint


SHARED = os.environ.get("CARE_SHARED")
needs_logs = pytest.mark.skipif(SHARED is None, reason="CARE_SHARED names no folder of recorded logs")
WILD = ("ardusub_small", "copter35_mixed_v1_v2", "copter47_sitl", "copter_real_radio_23min", "quadplane_vtol",
        "crawler_generic_autopilot", "one_packet_70bytes", "ardusub_pymavlink_bug")  # fmt: skip
LARGE = {"copter_real_radio_23min", "ardusub_pymavlink_bug"}


@needs_logs
@pytest.mark.parametrize("name", [pytest.param(name, marks=pytest.mark.long if name in LARGE else ()) for name in WILD])
def test_agrees_with_pymavlink_message_by_message(name: str) -> None:
    mavutil = pytest.importorskip("pymavlink.mavutil")
    path = Path(SHARED or "", "logs", "mavlink_tlog", f"{name}.tlog")
    log = open_log(path)
    assert isinstance(log, MavlinkLog)
    theirs: dict[str, list[Any]] = defaultdict(list)
    peer = mavutil.mavlink_connection(str(path))
    while (message := peer.recv_msg()) is not None:
        sender = (message.get_srcSystem(), message.get_srcComponent())
        if message.get_type() != "BAD_DATA":
            by = "" if sender == tuple(log.vehicle) else "@{}.{}".format(*sender)
            theirs[message.get_type() + by].append(message)
    tables = log.read({channel: tuple(rows[0].get_fieldnames()) for channel, rows in theirs.items()})
    assert set(tables) == set(theirs)
    first_s = next(iter(theirs.values()))[0]._timestamp - next(iter(tables.values())).t[0]
    for channel, rows in theirs.items():
        table = tables[channel]
        np.testing.assert_allclose(table.t, [row._timestamp - first_s for row in rows], atol=1e-5)
        for field in rows[0].get_fieldnames():
            assert all(map(same, table[field], (getattr(row, field) for row in rows))), (channel, field)


def same(ours: Any, their: Any) -> bool:
    if isinstance(their, str):
        return their == "".join(c if c.isascii() else "\ufffd" for c in ours)
    if isinstance(their, list):
        return all(map(same, ours, their))
    return bool(ours == their or (math.isnan(ours) and math.isnan(their)))


@needs_logs
def test_fetched_parameters_of_a_wild_log_are_those_of_its_file() -> None:
    folder = Path(SHARED or "", "logs")
    settings = open_log(folder / "mavlink_tlog" / "copter47_sitl.tlog").settings()
    lines = (folder / "configs" / "ardupilot_param" / "adgfuzz_mav.parm").read_text().split("\n")
    written = {parts[0]: float(parts[1]) for line in lines if len(parts := line.split()) == 2}
    assert len(settings) == len(written) == 1374
    agree = [name for name, value in written.items() if settings[name][0].value == pytest.approx(value, abs=1e-5)]
    assert len(agree) > 1360


def test_zeros_that_a_log_begins_with_do_not_hide_it(tmp_path: Path) -> None:
    path = flight().write(tmp_path / "run.tlog")
    sound = open_log(path).channels()
    path.write_bytes(bytes(10_000) + path.read_bytes())
    assert open_log(path).channels() == sound
    path.write_bytes(bytes(10_000))
    with pytest.raises(LogError, match="nothing but zeros"):
        open_log(path)


def test_a_second_vehicle_is_told_and_a_camera_or_a_transponder_is_none(tmp_path: Path) -> None:
    def heard(*others: tuple[int, int, int, int]) -> list[str]:
        path = tmp_path / "two.tlog"
        senders = {(1, 1): (2, 3), **{(system, part): (kind, pilot) for system, part, kind, pilot in others}}
        packets = []
        for t in range(20):
            for sender, (kind, pilot) in senders.items():
                beat = mavlink.MAVLink_heartbeat_message(kind, pilot, 0x51, 0, 4, 3)
                stamp = 1_700_000_000_000_000 + t * 1_000_000
                packets.append(struct.pack(">Q", stamp) + beat.pack(mavlink.MAVLink(None, *sender)))
            for _ in range(2):  # the vehicle sends most
                attitude = mavlink.MAVLink_attitude_message(t * 1000, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
                stamp = 1_700_000_000_000_000 + t * 1_000_000 + 1000
                packets.append(struct.pack(">Q", stamp) + attitude.pack(mavlink.MAVLink(None, 1, 1)))
        path.write_bytes(b"".join(packets))
        return [one.title for one in examine(run_model(open_log(path))).findings if "another" in one.title]

    assert heard((2, 1, 1, 3)) == ["another vehicle is in this telemetry: 2.1 (fixed wing)"]
    assert heard((255, 190, 6, 8), (1, 154, 26, 8), (42, 156, 27, 8), (1, 191, 18, 8)) == []


@pytest.mark.parametrize("second_boots_s", [40.0, -7.0])
def test_two_vehicles_under_one_system_id_are_told_and_neither_is_judged(tmp_path: Path, second_boots_s: float) -> None:
    good, both = Path(__file__).parents[1] / "data" / "arducopter_good.BIN", tmp_path / "both.tlog"
    one = write_tlog(tmp_path / "one.tlog", good, np.random.default_rng(0))
    packets = find_packets(FileArray.open(one))
    raw = one.read_bytes()
    parts = [raw[start:end] for start, end in zip(packets.start.tolist(), packets.end.tolist(), strict=True)]
    other = [_booted(part, second_boots_s) for part in parts]
    both.write_bytes(b"".join(chain.from_iterable(zip(parts, filter(None, other), strict=False))))
    assert "shared id" not in open_log(one).facts
    assert "two clocks" in open_log(both).facts["shared id"]
    found = read_and_judge(run_model(open_log(both)), load_profile("arducopter"))
    assert {result.status for result in found.results} == {"not_evaluated"}
    assert "two vehicles speak under one system id" in found.results[0].reason
    assert "two vehicles speak under one system id" in {f.title for f in examine(run_model(open_log(both))).findings}


@pytest.mark.parametrize("step_s", [3600.0, 40.0, -40.0])
def test_a_station_whose_clock_was_set_in_flight_is_told_and_costs_no_time(tmp_path: Path, step_s: float) -> None:
    good = Path(__file__).parents[1] / "data" / "arducopter_good.BIN"
    raw = bytearray(write_tlog(tmp_path / "one.tlog", good, np.random.default_rng(0)).read_bytes())
    whole = open_log(tmp_path / "one.tlog")
    places = find_packets(FileArray.open(tmp_path / "one.tlog")).start.tolist()
    for place in places[len(places) // 2 :]:
        stamp = struct.unpack_from(">Q", raw, place)[0] + int(step_s * 1e6)
        struct.pack_into(">Q", raw, place, stamp)
    (tmp_path / "set.tlog").write_bytes(raw)
    log = open_log(tmp_path / "set.tlog")
    assert [one.what for one in log.damage if one.is_jump] == [f"the clock of the log jumps by {step_s:+.0f} s"]
    assert log.duration_s == pytest.approx(whole.duration_s, abs=1.0)
    assert not [one for one in whole.damage if one.is_jump]


def test_a_link_that_is_silent_for_a_while_is_no_clock_that_was_set(tmp_path: Path) -> None:
    good = Path(__file__).parents[1] / "data" / "arducopter_good.BIN"
    one = write_tlog(tmp_path / "one.tlog", good, np.random.default_rng(0))
    packets, raw, whole = find_packets(FileArray.open(one)), one.read_bytes(), open_log(one)
    bounds = list(zip(packets.start.tolist(), packets.end.tolist(), strict=True))
    kept = bounds[: len(bounds) // 3] + bounds[len(bounds) // 2 :]
    (tmp_path / "gap.tlog").write_bytes(b"".join(raw[start:end] for start, end in kept))
    log = open_log(tmp_path / "gap.tlog")
    assert not log.damage
    assert log.duration_s == pytest.approx(whole.duration_s)


def _booted(packet: bytes, later_s: float) -> bytes:
    """A stamped packet of a vehicle that was started so much later; the packet itself where it tells no clock."""
    (message,) = mavlink.MAVLink(None).parse_buffer(packet[8:]) or [None]
    if getattr(message, "time_boot_ms", None) is None:
        return packet
    message.time_boot_ms = max(0, int(message.time_boot_ms - 1000 * later_s) % 2**32)
    return packet[:8] + bytes(message.pack(mavlink.MAVLink(None, message.get_srcSystem(), message.get_srcComponent())))


def test_a_link_that_falls_behind_and_restarts_are_one_vehicle() -> None:
    begun = np.cumsum([0.0, -290.0, -200.0, 4.5, -28.0, 5.0, -42.0, 3.5, 4.0, 3.5, 4.0, 3.5, 4.5])
    assert not _turns(np.repeat(begun, 5), 3.0)
    assert not _turns(np.repeat([0.0, -3.5, 0.0, -8.0, 0.0, -5.5, 0.0, -12.0, 0.0], 5), 3.0)
    assert _turns(np.tile([0.0, 0.0, 40.0], 10), 3.0)

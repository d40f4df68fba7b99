"""Classes of what an anonymous report or bundle must not say: places, days, addresses, serial numbers, names."""

from __future__ import annotations

import re
import time
import zipfile
from io import BytesIO
from pathlib import Path

import pytest

import care_core
from care_core.application.bundling import bundle_of
from care_core.application.case import Case, Request
from care_core.application.redaction import HIDDEN, LEFT_OUT, NO_PLACE, Redactor, redactor_of, without_places
from care_core.application.shared_parameters import may_go
from care_core.application.sharing import Sharing
from care_core.files import bundled
from tests.rewritten import write_text

SAMPLE = bundled("samples", "arducopter_failed.BIN")
ANONYMOUS = Sharing(positions=False, anonymous=True)
PLACES = (
    "Home N47 23 51 E8 32 44", "Home 47 23.85 N 8 32.73 E", "at 47,3977; 8,5455", "pos 47.39 8.54", "47.3 / 8.5",
    "47.3977N 8.5455E", "N47.39 E8.54", "S33 51 31 W151 12 33", "47\N{DEGREE SIGN}23'51\"N 8\N{DEGREE SIGN}32'44\"E",
    "47-23-51N 008-32-44E", "n47 23 51, e8 32 44", "-33.86/151.20", "32T 465123 5248765", "32T MT 65120 45678",
    "32TMT6512045", "465123 5248765", "8FVC9G8F+6X", "9G8F+6X", "JN47gh", "///filled.count.soap", "lat 47 lon 8",
    "elevation 488m", "alt 488 m above sea level", "488 m AMSL", "[47.39, 8.54]", "47.39|8.54", "472351N 0083244E",
    "4.739e+01, 8.545e+00", "goal at x 12.5 y 7.25", "goal x 12 y 7", "x 4663.5", "pose 4663.5, 5249.75",
    "goal 12.5 by 7.25", "home at 4.2 and 0", "position is 4663.50m, 5249.75m", "goal 12.5:7.2", "x12.5y7.2",
)  # fmt: skip
DAYS = (
    "started 21.11.26 08:45", "21.11.2026", "21. Nov 2026", "21nov26", "Nov 21", "November 21st, 2026", "Nov 2026",
    "11/21/26", "21/11/2026", "2026-11-21T08:45:20Z", "2026/11/21", "2026.11.21", "20261121", "20261121T084520Z",
    "2026-W47", "week 2446", "Sat 08:45", "21 - 11 - 2026", "1795250720", "21. Dez. 2026", "3rd of March",
)  # fmt: skip
ADDRESSES = (
    "10.7.0.3", "192.168.144.14:14550", "10.0.0.0/24", "fe80::1", "2001:db8:0:1::7", "C2:AF:51:03:CF:46",
    "c2-af-51-03-cf-46", "c2af.5103.cf46", "c2af5103cf46", "will@server", "http://server", "udp://10.7.0.3:14550",
    "gcs.local", "robot.example.com", r"\\server\share\will", "~will/logs", r"C:\logs\will", "/home/will/a.BIN",
    "+41 44 123 45 67", "044 123 45 67",
)  # fmt: skip
SERIALS = (
    "serial no 4711", "S/N: 4711", "SN 4711", "serial number is 4711", "tail N123AB", "ICAO 4B1A3C", "squawk 7123",
    "IMEI 35", "asset 12", "SSID Cube", "WiFi: Cube", "password will", "owner: will", "call sign mission", "unit 4711",
    "0036003A 3133510B", "board 36003A", "SYSID 42", "vehicle id 17", "room 12", "to 12 7",
    "position 12, 7, 0", "4B1A3C", "123e4567-e89b-12d3-a456-426614174000", "user will", "host server",
    "UUID 1234", "pilot: Mark", "robot=home", "site: North field",
)  # fmt: skip
NAMES = (
    "host robot7", "robot7 lost", "/husky_07/odom", "node /husky_07/odom gone", "uav12", "cart_3_left", "R2D2",
    "/will/odom", "/grant/cmd_vel", "field-laptop-7", "robot07",
)  # fmt: skip
USUAL = (
    "EKF3 IMU1 origin set", "GPS 1: detected as u-blox at 230400 baud", "Reached command #3", "Mission: 6 WP",
    "EKF3 IMU0 MAG0 in-flight yaw alignment complete", "PreArm: Need Position Estimate", "RC10: Fence enabled",
    "Battery 1 is low 10.43V used 2317 mAh", "Frame: QUAD/X", "Arm: AHRS: waiting for home", "mode Auto at 12.3 s",
    "Thrust Loss (3)", "/odom stopped", "Motor 2 lost",
)  # fmt: skip


@pytest.fixture(scope="module")
def hider() -> Redactor:
    return redactor_of(care_core.triage(SAMPLE), positions=ANONYMOUS.positions)


@pytest.mark.parametrize("text", [*PLACES, *DAYS, *ADDRESSES, *SERIALS, *NAMES], ids=ascii)
def test_a_message_with_a_secret_of_any_spelling_is_left_out(hider: Redactor, text: str) -> None:
    for said in (text, f"PreArm: {text}", f"{text}, waiting", f"({text})"):
        assert hider.said(said) == LEFT_OUT, said


@pytest.mark.parametrize("text", [*PLACES, *DAYS, *ADDRESSES, *NAMES], ids=ascii)
def test_of_other_texts_the_secret_is_left_out(hider: Redactor, text: str) -> None:
    kept = hider.text(text)
    assert HIDDEN in kept or NO_PLACE in kept


@pytest.mark.parametrize("text", USUAL)
def test_what_every_such_robot_says_stays(hider: Redactor, text: str) -> None:
    assert hider.said(text) == text


@pytest.mark.parametrize(
    "part", ["1 ", "47 ", "a.", "1.2 ", "ab:", "a", "0", "/a", "12-", "1.1.", "N47 23 ", "\\a", "serial id "]
)
def test_a_long_text_takes_no_time(part: str) -> None:
    began = time.perf_counter()
    Redactor(frozenset()).said(part * (20_000 // len(part)))
    assert time.perf_counter() - began < 5.0, "linear; it was minutes"


@pytest.mark.parametrize("gap", [" ", "\t", "\n", "\N{NO-BREAK SPACE}", " \t"], ids=ascii)
@pytest.mark.parametrize(
    "before", ["1.1", "123456", "12C 111111", "47\N{DEGREE SIGN}", "(1", "serial no", "1 of", "x", "N47"]
)
def test_long_white_space_takes_no_time_and_parts_nothing(before: str, gap: str) -> None:
    """A message of 300 characters took days: every gap of a pattern could take any part of it."""
    began = time.perf_counter()
    Redactor(frozenset()).said(f"{before}{gap * 20_000}x" * 3)
    assert time.perf_counter() - began < 5.0
    assert without_places(f"at 47.39{gap * 300}8.54") == f"at {NO_PLACE}"


# Numbers of parameters


@pytest.mark.parametrize(
    "name",
    ["NET_MACADDR0", "NET_IPADDR3", "NET_GWADDR3", "/initialpose/x", "NET_P1_IP0", "NET_REMPPP_IP1", "ADSB_ICAO_ID",
     "ADSB_SQUAWK",
     "COMPASS_DEV_ID", "COMPASS_DEV_ID2", "COMPASS_PRIO1_ID", "INS_ACC_ID", "INS_GYR2_ID", "BARO1_DEVID",
     "AHRS_ORIG_LAT", "AHRS_ORIG_ALT", "SIM_OPOS_LAT",
     "RALLY_LAT", "TERR_ALT0", "BARO1_GND_PRESS", "BARO_FIELD_ELV", "GND_ALT_OFFSET",
     "COMPASS_DEC", "STAT_BOOTCNT", "MNT1_SYSID_DFLT", "DID_UAS_ID", "GCS_SYSID", "MAV_SYSID", "SYSID_THISMAV",
     "SCR_USER1", "FOLL_SYSID", "BRD_SERIAL_NUM", "BATT_SERIAL_NUM", "CAM1_SERIAL", "GPS_CAN_NODEID1", "VTX_FREQ",
     "EK3_GSF", "ODID_X", "WPNAV_SECRET", "LTE_IP", "WEB_BIND_PORT", "SYS_AUTOSTART", "CAL_ACC0_ID", "NEW_ONE",
     "/camera/serial_no", "/husky_07/ip", "/a/initial_pose_x", "/datum/lat"],
)  # fmt: skip
@pytest.mark.parametrize("format", ["dataflash-bin", "px4-ulg", "ros1-bag"])
def test_a_parameter_goes_only_if_it_is_one_that_tunes(name: str, format: str) -> None:
    assert not may_go(name, frozenset(), format)
    assert may_go(name, frozenset((name,)), format), "the profile's own go: the answer is about them"


@pytest.mark.parametrize(
    ("name", "format"),
    [("LAND_SPEED", "dataflash-bin"), ("ATC_RAT_RLL_P", "dataflash-bin"), ("AVOID_MARGIN", "dataflash-bin"),
     ("EK3_POSNE_M_NSE", "dataflash-bin"), ("BATT_LOW_VOLT", "tlog"), ("MC_ROLLRATE_P", "px4-ulg"),
     ("/move_base/DWAPlannerROS/max_vel_x", "ros1-bag"), ("/controller_server.FollowPath.max_vel_x", "ros2-mcap")],
)  # fmt: skip
def test_what_tunes_a_robot_goes(name: str, format: str) -> None:
    assert may_go(name, frozenset(), format)


# Whole reports and bundles

PLANTED = ("NET_MACADDR0", "ADSB_ICAO_ID", "COMPASS_DEV_ID3", "CAM1_SERIAL", "AHRS_ORIG_LAT")
VALUE = 4921892


@pytest.fixture(scope="module")
def planted(tmp_path_factory: pytest.TempPathFactory) -> Case:
    path = write_text(tmp_path_factory.mktemp("logs") / "a.log", SAMPLE)
    lines = path.read_text(encoding="utf-8").splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("ARM, "))
    time_s = float(lines[at].split(", ")[1])
    said = [f"MSG, {time_s}, {text}" for text in (*PLACES, *DAYS, *ADDRESSES, *SERIALS, *NAMES)]
    number = next(line for line in lines if line.startswith("PARM, ")).split(", ")
    numbers = [", ".join((*number[:2], name, str(VALUE), *number[4:])) for name in PLANTED]
    path.write_text("\n".join([*lines[:at], *numbers, *said, *lines[at:]]) + "\n", encoding="utf-8")
    return care_core.triage(Request(path, since=SAMPLE))


def test_neither_report_nor_bundle_says_any_of_it(planted: Case) -> None:
    texts = {format: planted.report(format, ANONYMOUS) for format in ("markdown", "html", "json", "yaml", "text")}
    with zipfile.ZipFile(BytesIO(bundle_of(planted, ANONYMOUS, "0").content)) as archive:
        texts |= {name: archive.read(name).decode() for name in archive.namelist()}
    for name, text in texts.items():
        for secret in (*PLACES, *DAYS, *ADDRESSES, *SERIALS, *NAMES):
            assert secret not in text or not re.search(rf"(?<!\w){re.escape(secret)}(?!\w)", text), (name, secret)
        assert str(VALUE) not in text, name
        assert not [one for one in PLANTED if one in text], name


def test_the_planted_log_of_the_attack_gives_nothing_away(recorded: Path) -> None:
    path = recorded / "attack/leaks.BIN"
    if not path.is_file():
        pytest.skip("the folder of recorded runs has no such log")
    content = bundle_of(care_core.triage(path), ANONYMOUS, "0").content
    with zipfile.ZipFile(BytesIO(content)) as archive:
        texts = {name: archive.read(name).decode() for name in archive.namelist() if "/signals/" not in name}
    for name, text in texts.items():
        for secret in ("47.39", "47,39", "8.54", "N47 23", "47 23.85", "4711", "robot7", "21.11.26", "share", "~will",
                       "Cube", "MACADDR", "IPADDR", "ICAO", "4921892", "SQUAWK", "OPOS", "_ID,"):  # fmt: skip
            assert secret not in text, (name, secret)

"""PX4's parameters by release, from the table beside this module."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path

from care_core.metadata.fact import Fact, FactType, codes, expanded, lines_of, number
from care_core.records import Record

_TABLE = Path(__file__).with_name("px4.tsv")
RELEASES = ("1.6", "1.7", "1.8", "1.9", "1.10", "1.11", "1.12", "1.13", "1.14", "1.15", "1.16", "1.17", "1.18")
SOURCE = "PX4's parameter reference"
OWNER = "PX4"
RENAMED: Mapping[str, tuple[str, float]] = {
    **{f"MPC_{axis}_VEL_{gain}": (f"MPC_{axis}_VEL_{gain}_ACC", 20.0) for axis in ("XY", "Z") for gain in "PID"},
    **{f"EKF2_GPS_POS_{axis}": (f"SENS_GPS0_OFF{axis}", 1.0) for axis in "XYZ"},
    **{f"PWM_{old}": (f"PWM_MAIN_{new}", 1.0)
       for old, new in (("MIN", "MIN"), ("MAX", "MAX"), ("RATE", "RATE"), ("DISARMED", "DISARM"))},
    "LED_RGB_MAXBRT": ("SYS_RGB_MAXBRT", 1 / 15),
    "VT_DWN_PITCH_MAX": ("VT_PITCH_MIN", -1.0),
    **{old: (new, 1.0) for old, new in (
        ("MC_DTERM_CUTOFF", "IMU_DGYRO_CUTOFF"), ("EKF2_GPS_MASK", "SENS_GPS_MASK"), ("EKF2_GPS_TAU", "SENS_GPS_TAU"),
        ("ASPD_STALL", "FW_AIRSPD_STALL"), ("NAV_GPSF_LT", "FW_GPSF_LT"), ("NAV_GPSF_R", "FW_GPSF_R"),
        ("IMU_GYRO_NF_FREQ", "IMU_GYRO_NF0_FRQ"), ("IMU_GYRO_NF_BW", "IMU_GYRO_NF0_BW"),
        ("VT_PTCH_MIN", "VT_PITCH_MIN"), ("VT_LND_PTCH_MIN", "VT_LND_PITCH_MIN"),
        ("ASPD_SC_P_NOISE", "ASPD_SCALE_NSD"), ("ASPD_W_P_NOISE", "ASPD_WIND_NSD"), ("FW_THR_CRUISE", "FW_THR_TRIM"),
        ("VT_FW_DIFTHR_SC", "VT_FW_DIFTHR_S_Y"), ("LAUN_ALL_ON", "FW_LAUN_DETCN_ON"),
        ("LAUN_CAT_A", "FW_LAUN_AC_THLD"), ("LAUN_CAT_T", "FW_LAUN_AC_T"), ("LAUN_CAT_MDEL", "FW_LAUN_MOT_DEL"),
        ("RWTO_L1_PERIOD", "RWTO_NPFG_PERIOD"), ("FW_L1_R_SLEW_MAX", "FW_PN_R_SLEW_MAX"),
        ("FW_L1_PERIOD", "NPFG_PERIOD"), ("ASPD_FALLBACK_GW", "ASPD_FALLBACK"),
    )},
}  # fmt: skip
"""Old name, new name, and what its value is multiplied by: what the firmware does with a file of an older release
(param_translation.cpp of 1.11 to 1.18). Those whose values mean something else are left out."""
_TYPES: Mapping[str, FactType] = {"f": "float", "i": "int", "b": "bool"}


class _Row(Record):
    releases: tuple[str, ...]
    cells: tuple[str, ...]


def known_in(name: str) -> frozenset[str]:
    """The releases that document a parameter; empty for none."""
    return frozenset().union(*(row.releases for row in _rows().get(name, ())))


def names() -> Iterable[str]:
    """Every parameter of the table."""
    return _rows().keys()


def facts_of(name: str, releases: Iterable[str] = RELEASES) -> tuple[Fact, ...]:
    """What these releases say of a parameter, the newest last; several where they differ."""
    wanted = frozenset(releases)
    return tuple(_fact(name, row, told) for row in _rows().get(name, ()) if (told := wanted.intersection(row.releases)))


def fact_of(name: str, version: tuple[int, ...] | None = None) -> Fact | None:
    """What a release says of a parameter; the newest that knows it where the version is unknown."""
    exact = [] if version is None else [".".join(map(str, version[:2]))]
    found = facts_of(name, exact) or facts_of(name)
    return found[-1] if found else None


def span(releases: Iterable[str]) -> str:
    """Releases in words: PX4 1.15, or PX4 1.13 to 1.17."""
    told = sorted(releases, key=RELEASES.index)
    return f"PX4 {told[0]}" if len(told) == 1 else f"PX4 {told[0]} to {told[-1]}"


def _fact(name: str, row: _Row, releases: Iterable[str]) -> Fact:
    kind, low, high, unit, values, bits, default, flags = row.cells
    told = span(releases)
    return Fact(
        name,
        OWNER,
        f"{SOURCE}, {told}",
        type=_TYPES[kind],
        default=default,
        low=number(low),
        high=number(high),
        values=tuple((code, "") for code in codes(values)),
        bits=frozenset(map(int, codes(bits))),
        unit=unit,
        reboot="R" in flags,
        releases=told,
    )


@cache
def _rows() -> Mapping[str, list[_Row]]:
    found: dict[str, list[_Row]] = {}
    for line in lines_of(_TABLE)[1:]:
        pattern, releases, *cells = line.split("\t")
        row = _Row(_releases(releases), tuple(cells))
        for name in expanded(pattern):
            found.setdefault(name, []).append(row)
    return found


def _releases(text: str) -> tuple[str, ...]:
    """1.14-1.16 is three of them, nothing is all."""
    first, dash, last = text.partition("-")
    if not text:
        return RELEASES
    start, end = RELEASES.index(first), RELEASES.index(last if dash else first)
    return RELEASES[start : end + 1]

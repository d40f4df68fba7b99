"""Parameters that changed their name, and with it their unit, from one firmware to the next.

Copter and the VTOL half of Plane 4.7: what the firmware does on its first start after the update, as listed in
ArduPilot's `Tools/scripts/convert_params_4_7.py`; receivers in 4.6: `Tools/autotest/test_param_upgrade.py`. Before:
`Copter::convert_pid_parameters` and the conversion tables of ArduCopter/Parameters.cpp. Names whose conversion depends
on other parameters (rate gains of 3.3, ARMING_CHECK) are left out. Nav2: its parameter files (nav2_bringup) of 1.3
and 1.5.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence
from functools import cache

from care_core.records import Record

Version = tuple[int, ...]
_FIRST: Version = (0,)
_15 = (1, 5)
_47, _471 = (4, 7), (4, 7, 1)
_36, _34, _33, _35, _42, _45, _46 = (3, 6), (3, 4), (3, 3), (3, 5), (4, 2), (4, 5), (4, 6)


class ParameterAlias(Record):
    """A parameter as one firmware names it. A value under this name is `scale` times the value under the first."""

    name: str
    since: Version
    scale: float = 1.0


Chain = tuple[ParameterAlias, ...]


def _chain(first: str, *later: tuple[Version, str, float]) -> Chain:
    return (ParameterAlias(first, _FIRST), *(ParameterAlias(name, since, scale) for since, name, scale in later))


def _of_position(old: str) -> Iterator[Chain]:
    """The position controller: PSC_ of Copter, Q_P_ of Plane."""
    yield _chain(f"{old}JERK_XY", (_47, f"{old}JERK_NE", 1), (_471, f"{old}NE_JERK", 1))
    yield _chain(f"{old}JERK_Z", (_47, f"{old}JERK_D", 1), (_471, f"{old}D_JERK", 1))
    for suffix in ("I", "IMAX", "FLTE", "D", "FLTD", "FF"):
        scale = 0.01 if suffix == "IMAX" else 1.0
        yield _chain(f"{old}VELZ_{suffix}", (_47, f"{old}D_VEL_{suffix}", scale))
        if suffix not in _OLD_PSC_XY or old != "PSC_":
            yield _chain(f"{old}VELXY_{suffix}", (_47, f"{old}NE_VEL_{suffix}", scale))
    for suffix in ("FF", "FLTT", "FLTE", "FLTD", "SMAX", "PDMX", "D_FF", "NTF", "NEF"):
        yield _chain(f"{old}ACCZ_{suffix}", (_47, f"{old}D_ACC_{suffix}", 1))
    if old == "PSC_":
        return
    yield _chain(f"{old}POSZ_P", (_47, f"{old}D_POS_P", 1))
    yield _chain(f"{old}POSXY_P", (_47, f"{old}NE_POS_P", 1))
    for axis, new in (("VELZ", "D_VEL"), ("VELXY", "NE_VEL")):
        yield _chain(f"{old}{axis}_P", (_47, f"{old}{new}_P", 1))
    for suffix, scale in _ACCEL_SCALES.items():
        yield _chain(f"{old}ACCZ_{suffix}", (_47, f"{old}D_ACC_{suffix}", scale))


_OLD_PSC_XY = {"I", "IMAX"}
_ACCEL_SCALES = {"P": 0.1, "I": 0.1, "D": 0.1, "IMAX": 0.001}


def _of_old_copters() -> Iterator[Chain]:
    """Names of the position controller before 3.6, and before 3.3."""
    yield _chain("THR_ALT_P", (_33, "POS_Z_P", 1), (_36, "PSC_POSZ_P", 1), (_47, "PSC_D_POS_P", 1))
    yield _chain("HLD_LAT_P", (_33, "POS_XY_P", 1), (_36, "PSC_POSXY_P", 1), (_47, "PSC_NE_POS_P", 1))
    yield _chain("THR_RATE_P", (_33, "VEL_Z_P", 1), (_36, "PSC_VELZ_P", 1), (_47, "PSC_D_VEL_P", 1))
    for suffix, scale in (("P", 1.0), ("I", 1.0), ("IMAX", 0.01)):
        yield _chain(f"VEL_XY_{suffix}", (_36, f"PSC_VELXY_{suffix}", 1), (_47, f"PSC_NE_VEL_{suffix}", scale))
    for suffix, scale in _ACCEL_SCALES.items():
        yield _chain(
            f"THR_ACCEL_{suffix}", (_33, f"ACCEL_Z_{suffix}", 1), (_36, f"PSC_ACCZ_{suffix}", 1),
            (_47, f"PSC_D_ACC_{suffix}", scale),
        )  # fmt: skip


def _of_waypoints(old: str, new: str) -> Iterator[Chain]:
    for before, after in (("SPEED", "SPD"), ("RADIUS", "RADIUS_M"), ("SPEED_UP", "SPD_UP"), ("SPEED_DN", "SPD_DN"),
                          ("ACCEL", "ACC"), ("ACCEL_Z", "ACC_Z"), ("ACCEL_C", "ACC_CNR")):  # fmt: skip
        yield _chain(f"{old}{before}", (_47, f"{new}{after}", 0.01))
    if old != new:
        for suffix in ("RFND_USE", "JERK", "TER_MARGIN"):
            yield _chain(f"{old}{suffix}", (_47, f"{new}{suffix}", 1))


def _of_attitude(prefix: str) -> Iterator[Chain]:
    yield _chain(f"{prefix}SLEW_YAW", (_47, f"{prefix}RATE_WPY_MAX", 0.01))
    for axis in "RPY":
        yield _chain(f"{prefix}ACCEL_{axis}_MAX", (_47, f"{prefix}ACC_{axis}_MAX", 0.01))


def _of_loiter(prefix: str) -> Iterator[Chain]:
    for old, before, after in (
        ("LOIT_SPEED", "SPEED", "SPEED_MS"), ("LOIT_MAXA", "ACC_MAX", "ACC_MAX_M"),
        ("LOIT_MINA", "BRK_ACCEL", "BRK_ACC_M"), ("LOIT_JERK", "BRK_JERK", "BRK_JRK_M"),
    ):  # fmt: skip
        now = (_47, f"{prefix}{after}", 0.01)
        if prefix == "LOIT_":
            yield _chain(f"WPNAV_{old}", (_36, f"{prefix}{before}", 1), now)
        else:
            yield _chain(f"{prefix}{before}", now)


def _of_copter() -> Iterator[Chain]:
    yield from _of_position("PSC_")
    yield from _of_old_copters()
    yield from _of_waypoints("WPNAV_", "WP_")
    yield from _of_attitude("ATC_")
    yield from _of_loiter("LOIT_")
    for old, new in (
        ("ANGLE_MAX", "ATC_ANGLE_MAX"), ("CIRCLE_RADIUS", "CIRCLE_RADIUS_M"), ("AVOID_ANGLE_MAX", "AVOID_ANG_MAX"),
        ("RTL_ALT", "RTL_ALT_M"), ("RTL_SPEED", "RTL_SPEED_MS"), ("RTL_ALT_FINAL", "RTL_ALT_FINAL_M"),
        ("RTL_CLIMB_MIN", "RTL_CLIMB_MIN_M"), ("LAND_SPEED", "LAND_SPD_MS"), ("LAND_SPEED_HIGH", "LAND_SPD_HIGH_MS"),
        ("LAND_ALT_LOW", "LAND_ALT_LOW_M"), ("PHLD_BRAKE_ANGLE", "PHLD_BRK_ANGLE"), ("PILOT_SPEED_DN", "PILOT_SPD_DN"),
        ("PILOT_ACCEL_Z", "PILOT_ACC_Z"), ("PILOT_TKOFF_ALT", "PILOT_TKO_ALT_M"),
    ):  # fmt: skip
        yield _chain(old, (_47, new, 0.01))
    yield _chain("PHLD_BRAKE_RATE", (_47, "PHLD_BRK_RATE", 1))
    yield _chain("PILOT_VELZ_MAX", (_36, "PILOT_SPEED_UP", 1), (_47, "PILOT_SPD_UP", 0.01))
    yield _chain("FRAME", (_35, "FRAME_TYPE", 1))
    for axis in ("RLL", "PIT", "YAW"):
        yield _chain(f"STB_{axis}_P", (_34, f"ATC_ANG_{axis}_P", 1))
    yield _chain("FS_BATT_VOLTAGE", (_36, "BATT_LOW_VOLT", 1))
    yield _chain("FS_BATT_MAH", (_36, "BATT_LOW_MAH", 1))
    yield _chain("FS_BATT_ENABLE", (_36, "BATT_FS_LOW_ACT", 1))
    # Stick gain to rate in degrees per second: convert_old_parameters_scaled with 45.
    yield _chain("ACRO_RP_P", (_42, "ACRO_RP_RATE", 45))
    yield _chain("ACRO_YAW_P", (_42, "ACRO_Y_RATE", 45))


def _of_quadplane() -> Iterator[Chain]:
    yield from _of_position("Q_P_")
    yield from _of_waypoints("Q_WP_", "Q_WP_")
    yield from _of_attitude("Q_A_")
    yield from _of_loiter("Q_LOIT_")
    yield _chain("Q_ANGLE_MAX", (_47, "Q_A_ANGLE_MAX", 0.01))


def _of_plane() -> Iterator[Chain]:
    """What Plane 4.5 renamed, from centimetres and hundredths of a degree to metres and degrees where it says so
    (ArduPlane/Parameters.cpp and the parameter lists of 4.4 and 4.5)."""
    for old, new, scale in (
        ("TRIM_ARSPD_CM", "AIRSPEED_CRUISE", 0.01), ("ARSPD_FBW_MIN", "AIRSPEED_MIN", 1.0),
        ("ARSPD_FBW_MAX", "AIRSPEED_MAX", 1.0), ("MIN_GNDSPD_CM", "MIN_GROUNDSPEED", 0.01),
        ("LIM_ROLL_CD", "ROLL_LIMIT_DEG", 0.01), ("LIM_PITCH_MAX", "PTCH_LIM_MAX_DEG", 0.01),
        ("LIM_PITCH_MIN", "PTCH_LIM_MIN_DEG", 0.01), ("TRIM_PITCH_CD", "PTCH_TRIM_DEG", 0.01),
        ("ALT_HOLD_RTL", "RTL_ALTITUDE", 0.01), ("ALT_HOLD_FBWCM", "CRUISE_ALT_FLOOR", 0.01),
        ("LAND_PITCH_CD", "LAND_PITCH_DEG", 0.01), ("Q_LAND_SPEED", "Q_LAND_FINAL_SPD", 0.01),
    ):  # fmt: skip
        yield _chain(old, (_45, new, scale))


def _of_all() -> Iterator[Chain]:
    for old, new in (("SYSID_THISMAV", "MAV_SYSID"), ("SYSID_MYGCS", "MAV_GCS_SYSID"),
                     ("TELEM_DELAY", "MAV_TELEM_DELAY"), ("EK3_MAX_FLOW", "EK3_FLOW_MAX")):  # fmt: skip
        yield _chain(old, (_47, new, 1))
    for instance in "123456789A":
        for before, after in (("MIN_CM", "MIN"), ("MAX_CM", "MAX"), ("GNDCLEAR", "GNDCLR")):
            yield _chain(f"RNGFND{instance}_{before}", (_47, f"RNGFND{instance}_{after}", 0.01))
    # In 4.6 each receiver got parameters of its own (ArduPilot's Tools/autotest/test_param_upgrade.py lists them).
    for name in ("TYPE", "GNSS_MODE", "RATE_MS", "DELAY_MS", "COM_PORT"):
        yield _chain(f"GPS_{name}", (_46, f"GPS1_{name}", 1))
        yield _chain(f"GPS_{name}2", (_46, f"GPS2_{name}", 1))
    for receiver in "12":
        yield _chain(f"GPS_CAN_NODEID{receiver}", (_46, f"GPS{receiver}_CAN_NODEID", 1))
        yield _chain(f"GPS_MB{receiver}_TYPE", (_46, f"GPS{receiver}_MB_TYPE", 1))
        for axis in "XYZ":
            yield _chain(f"GPS_POS{receiver}_{axis}", (_46, f"GPS{receiver}_POS_{axis}", 1))
            yield _chain(f"GPS_MB{receiver}_OFS_{axis}", (_46, f"GPS{receiver}_MB_OFS_{axis}", 1))


def _of_nav2() -> Iterator[Chain]:
    """MPPI's pruning went to the controller server in 1.5."""
    server = "/controller_server"
    yield _chain(f"{server}.FollowPath.prune_distance", (_15, f"{server}.PathHandler.prune_distance", 1))


_FAMILIES: Mapping[str, tuple[str, ...]] = {
    "copter": ("copter", "all"), "heli": ("copter", "all"), "plane": ("plane", "all"),
    "quadplane": ("plane", "quadplane", "all"), "nav2": ("nav2",),
}  # fmt: skip


@cache
def _chains(kind: str) -> Mapping[str, Chain]:
    made = {"copter": _of_copter, "plane": _of_plane, "quadplane": _of_quadplane, "all": _of_all, "nav2": _of_nav2}
    found = [chain for family in _FAMILIES.get(kind, ("all",)) for chain in made[family]()]
    return {alias.name: chain for chain in found for alias in chain}


def aliases_of(name: str, kind: str = "copter") -> Sequence[ParameterAlias]:
    """Every name that a parameter has had, oldest first; only its own where it never had another.

    `scale` of each is relative to `name`: a value under that alias is `scale` times the value under `name`.
    """
    chain = _chains(kind).get(name)
    if chain is None:
        return (ParameterAlias(name, _FIRST),)
    own = next(alias.scale for alias in chain if alias.name == name)
    return tuple(ParameterAlias(one.name, one.since, one.scale / own) for one in chain)


def renamed(name: str, version: Version, kind: str = "copter") -> ParameterAlias:
    """The name by which firmware of this version knows a parameter, given under any of its names.

    Development versions carry the next release's number before they carry its names: where there is a log, ask
    `alias_in` instead.
    """
    known = aliases_of(name, kind)
    return next((alias for alias in reversed(known) if alias.since <= tuple(version)), known[0])


def alias_in(name: str, held: Container[str], kind: str = "copter") -> ParameterAlias | None:
    """The name by which a log or a file holds a parameter, given under any of its names; None where it holds none."""
    known = aliases_of(name, kind)
    own = next((alias for alias in known if alias.name == name), None)
    if name in held:
        return own
    return next((alias for alias in reversed(known) if alias.name in held), None)

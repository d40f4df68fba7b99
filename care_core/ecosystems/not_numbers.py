"""Parameters whose value is not a number, or endless, as a calibration that failed leaves them.

Whatever is computed with one is no number either: a field, a rate, an output. So it is the cause where what reads it
failed, and worth mending where nothing did.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Container, Iterator, Mapping

from care_core.ecosystems.base import Limits
from care_core.ecosystems.findings import Finding, FindingKind
from care_core.run import Setting, shown
from care_core.text import first_of, listed

LIMITS = Limits()
_SURE_P = LIMITS.add(
    "probability of what is not a number", 0.95, "", "whatever is computed with it is no number either"
)
_READ_BY: Mapping[FindingKind, re.Pattern[str]] = {
    "compass": re.compile(r"COMPASS_|CAL_MAG"),
    "imu": re.compile(r"INS_|CAL_(GYRO|ACC)|IMU_"),
    "barometer": re.compile(r"BARO|GND_|CAL_BARO|SENS_BARO"),
    "gps": re.compile(r"GPS"),
    "airspeed": re.compile(r"ARSPD|ASPD|SENS_DPRES"),
    "estimator": re.compile(r"EKF?\d?_|AHRS_"),
    "motor": re.compile(r"MOT_|SERVO\d|CA_|THR_|PWM_"),
    "battery": re.compile(r"BATT?\d?_"),
    "radio": re.compile(r"RC(MAP_|\d)"),
}
"""Beginnings of parameters by what reads them; the rest are of the control of attitude, height and way."""
FLY: frozenset[FindingKind] = frozenset(("compass", "imu", "barometer", "estimator", "motor", "tuning"))
"""What control is lost with."""
_CORRECTION = re.compile(r"COMPASS_(OFS|MOT|ODI)\d?_[XYZ]|INS_(GYR|ACC)\d?OFFS_[XYZ]|AHRS_TRIM_[XYZ]|CAL_\w+OFF")
"""What is added to a measurement: without it the sensor reads as it does before it is calibrated."""
_NAMED = 6


def is_number(value: float | str) -> bool:
    """Whether a vehicle can compute with a value."""
    return isinstance(value, str) or math.isfinite(value)


def broken(settings: Mapping[str, tuple[Setting, ...]]) -> tuple[str, ...]:
    """The parameters that are not numbers as first driven."""
    return tuple(name for name, history in settings.items() if history and not is_number(history[0].value))


def instead(name: str, default_of: Callable[[str], float | None]) -> float | None:
    """What to set a parameter to: the firmware's default, or no correction; None where nobody knows."""
    known = default_of(name)
    return 0.0 if known is None and _CORRECTION.match(name) else known


def find(
    settings: Mapping[str, tuple[Setting, ...]],
    default_of: Callable[[str], float | None],
    end_s: float,
    *,
    failed: Container[FindingKind],
    source: str,
) -> Iterator[Finding]:
    """One finding for those of each part that reads them.

    Args:
        default_of: what the firmware sets a parameter to; None where nobody knows.
        failed: parts that failed.
    """
    by_part: dict[FindingKind, list[str]] = {}
    for name in broken(settings):
        by_part.setdefault(_part(name), []).append(name)
    for part, names in by_part.items():
        wanted = tuple((name, value) for name in names if (value := _value(settings[name][0], default_of)) is not None)
        yield Finding(
            kind=part,
            title=f"{first_of(names, _NAMED) if len(names) > _NAMED else listed(names)} "
            + ("are not numbers" if len(names) > 1 else "is not a number"),
            onset_s=0.0,
            end_s=end_s,
            severity="critical" if part in failed else "warning",
            evidence=f"{', '.join(f'{name}={shown(settings[name][0].value)}' for name in names[:_NAMED])}: "
            + _mending(wanted, part),
            source=source,
            suspect="parameter",
            probability=_SURE_P,
            parameters=tuple(names),
            wanted=wanted,
        )


def _part(name: str) -> FindingKind:
    return next((part for part, names in _READ_BY.items() if names.match(name)), "tuning")


def _value(setting: Setting, default_of: Callable[[str], float | None]) -> float | None:
    """What to put instead: the default in the log, the firmware's, or no correction."""
    if isinstance(setting.default, (int, float)) and math.isfinite(setting.default):
        return float(setting.default)
    return instead(setting.name, default_of)


def _mending(wanted: tuple[tuple[str, float], ...], part: FindingKind) -> str:
    if not wanted:
        return "put the default back"
    values = {value for _, value in wanted}
    to = f"each to {shown(wanted[0][1])}" if len(values) == 1 and len(wanted) > 1 else ""
    told = to or listed([f"{name} to {shown(value)}" for name, value in wanted[:_NAMED]])
    return f"set {told}" + (", or calibrate the compass again" if part == "compass" else "")

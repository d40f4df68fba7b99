"""What belongs to one vehicle alone, and whether two configurations can be of the same one.

A board's serial outlives the airframe that the board is moved to. The sensors of a vehicle and what was calibrated on
it stay: one value of a calibration may be set wrong, and an update or a new tune changes some parameters, but not most.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from fnmatch import translate

from care_core.configs.driven import same_value

_IDENTITY = (
    "FRAME_CLASS", "Q_FRAME_CLASS", "SYS_AUTOSTART", "MAV_TYPE", "INS_*_ID", "COMPASS_DEV_ID*", "BARO*_DEVID",
    "CAL_ACC*_ID", "CAL_GYRO*_ID", "CAL_MAG*_ID",
)  # fmt: skip
"""The airframe and the sensors on it, ArduPilot's and PX4's alike."""
_CALIBRATION = (
    "INS_ACC*OFFS_[XYZ]", "INS_ACC*SCAL_[XYZ]", "INS[0-9]_ACC*", "COMPASS_OFS*_[XYZ]", "COMPASS_DIA*_[XYZ]",
    "CAL_ACC*_[XYZ]*", "CAL_MAG*_[XYZ]*", "BATT*_CAPACITY", "BAT*_CAPACITY", "BATT*_VOLT_MULT", "BATT*_AMP_PERVLT",
)  # fmt: skip
"""What is measured once for a vehicle, and differs from one to the next."""
_MOST_CALIBRATED = 0.5
"""The share of what was calibrated that may differ: a compass may have been calibrated anew, or one value set wrong."""
_MOST_CHANGED, _LEAST_CHANGED = 0.05, 10
"""The share of the other parameters that may differ, and the number that always may: an airframe of another kind has
some hundred of a thousand otherwise, a session of tuning some tens."""
Values = Mapping[str, float | str]


def _any_of(patterns: tuple[str, ...]) -> re.Pattern[str]:
    return re.compile("|".join(map(translate, patterns)))


_IS_IDENTITY, _IS_CALIBRATION = _any_of(_IDENTITY), _any_of(_CALIBRATION)


def individual(settings: Values) -> dict[str, float | str]:
    """The parameters that belong to one vehicle alone."""
    return {name: value for name, value in settings.items() if _is_individual(name)}


def may_be_same_vehicle(one: Values, other: Values) -> bool:
    """Whether two configurations can be of one vehicle, by what both hold: nothing in common tells nothing against."""
    both = {name: same_value(value, other[name]) for name, value in one.items() if name in other}
    calibrated = [same for name, same in both.items() if _IS_CALIBRATION.match(name)]
    chosen = [same for name, same in both.items() if not _is_individual(name)]
    return (
        all(same for name, same in both.items() if _IS_IDENTITY.match(name))
        and calibrated.count(False) <= _MOST_CALIBRATED * len(calibrated)
        and chosen.count(False) <= max(_LEAST_CHANGED, _MOST_CHANGED * len(chosen))
    )


def _is_individual(name: str) -> bool:
    return bool(_IS_IDENTITY.match(name) or _IS_CALIBRATION.match(name))

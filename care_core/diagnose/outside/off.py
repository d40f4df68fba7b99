"""Which parameters outside the profile are off: off the firmware's default, off the last good run, off their range."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping

from care_core.configs.driven import same_value
from care_core.ecosystems.vehicles.self_written import SIMULATOR_PREFIX, is_self_written
from care_core.ecosystems.vehicles.vehicle import Vehicle
from care_core.metadata import ardupilot
from care_core.metadata.causal_map import NO_CAUSE, Meaning, meaning_of
from care_core.metadata.firmware import fact_of, is_code
from care_core.records import Record
from care_core.run import Setting

TABLED = (4, 3), (4, 6)
"""Releases whose defaults are about those of the table, where a log holds none."""
_AT_EVERY_START = re.compile(r"INS\d?_GYR\d?_?OFF.*|COMPASS_PRIO\d_ID|.*_DEV_?ID\d?|BARO\d_GND_PRESS|STAT_.*")
_COUNTED = re.compile(r"(CA_ROTOR|CA_SV_CS|CA_SV_TL)(\d+)_")
"""Parts of PX4's control allocation, numbered from 0; CA_ROTOR_COUNT and the like tell how many there are."""
UNFELT = 1e-5
"""What differs from 0 by less only marks a calibration as done (SENS_BOARD_X_OFF of PX4's simulated airframes)."""


class OffParameter(Record):
    """A parameter that is not as it would be without anybody's hand."""

    name: str
    value: float
    default: float
    meaning: Meaning
    is_changed: bool | None
    """Whether it differs from the last good run; None where that is not known."""
    is_out_of_range: bool
    """Whether it lies outside its documented range, or is no documented code."""
    is_code: bool
    """Whether its values have no order."""
    last_good: float | None = None

    @property
    def back(self) -> float:
        """The value to put it back to: the last good run's, else the firmware's default."""
        return self.default if self.last_good is None else self.last_good


def off_parameters(
    settings: Mapping[str, Setting], vehicle: Vehicle, modelled: Collection[str], good: Mapping[str, Setting] | None
) -> Iterator[OffParameter]:
    """The parameters of a vehicle that are off, without those that the profile models, that the vehicle writes itself,
    and that move nothing.

    Args:
        modelled: parameters of the profile's options, by their names in the log.
        good: the parameters of the last good run, None where none is known; a history keeps none that a vehicle writes
            itself.
    """
    for name, setting in settings.items():
        if name in modelled or _is_nobodys(name) or not isinstance(setting.value, (int, float)):
            continue
        if _is_beyond_count(name, settings):
            continue
        default = _default(setting, vehicle)
        before = None if good is None or name not in good else good[name].value
        last_good = float(before) if isinstance(before, (int, float)) else None
        is_unknown = good is None or (name not in good and is_self_written(name))
        is_changed = None if is_unknown else last_good is None or not same_value(last_good, setting.value)
        back = default if default is not None else last_good
        if back is None or (_is_default(default, setting.value) and not is_changed):
            continue
        meaning = meaning_of(name, vehicle.kind)
        if meaning is None or meaning.role in NO_CAUSE:
            continue
        yield OffParameter(
            name,
            float(setting.value),
            back,
            meaning,
            is_changed,
            *_documented(name, float(setting.value), vehicle),
            last_good,
        )


def _is_default(default: float | None, value: float) -> bool:
    return same_value(default, value) or (default == 0 and abs(value) < UNFELT)


def _is_beyond_count(name: str, settings: Mapping[str, Setting]) -> bool:
    """Whether it describes a rotor or a surface that the vehicle has none of: nothing reads it."""
    part = _COUNTED.match(name)
    count = None if part is None else settings.get(f"{part[1]}_COUNT")
    return (
        part is not None and count is not None and isinstance(count.value, (int, float)) and int(part[2]) >= count.value
    )


def _is_nobodys(name: str) -> bool:
    """Whether a vehicle writes it at every start, or it is the simulated world's."""
    return name.startswith(SIMULATOR_PREFIX) or _AT_EVERY_START.fullmatch(name) is not None


def _default(setting: Setting, vehicle: Vehicle) -> float | None:
    if isinstance(setting.default, (int, float)):
        return float(setting.default)
    if vehicle.version is None or not TABLED[0] <= vehicle.version[:2] <= TABLED[1]:
        return None
    return ardupilot.firmware_default(setting.name, vehicle.kind)


def _documented(name: str, value: float, vehicle: Vehicle) -> tuple[bool, bool]:
    """Whether a value lies outside what is documented, and whether it is a code."""
    fact = fact_of(name, vehicle.kind, vehicle.version)
    return (False, False) if fact is None else (not fact.allows(value), is_code(fact))

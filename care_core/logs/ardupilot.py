"""What ArduPilot's three kinds of log have in common: how parameters, firmware, frame and wall clock are told."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from datetime import datetime, timedelta, timezone
from typing import NamedTuple

import numpy as np

from care_core.logs.base import Table, Wanted
from care_core.run import Setting, is_said_again

# GPS time runs ahead of UTC by the leap seconds since 1980: 18 since 2017, and none is announced.
_GPS_EPOCH = datetime(1980, 1, 6, tzinfo=timezone.utc) - timedelta(seconds=18)
# A week that no receiver has reached yet is a flipped bit.
_LAST_WEEK, _WEEK_MS = 5200, 7 * 24 * 3600 * 1000
_GPS_FIELDS = (("GWk", "GMS"), ("Week", "TimeMS"))
_FIRMWARE = re.compile(r"(?:(?:Ardu|APM:)(Copter|Plane|Rover|Sub)|AntennaTracker|Blimp|Rover) V\d")
_OTHER_NAME = re.compile(r"\S.* [Vv]\d+\.\d+\S* \([0-9a-f]{8}\)")
"""A firmware that its vendor named says itself as ArduPilot does, with its commit: "HawkCopter V4.5.5 (cff126f5)"."""
_VEHICLES = {"copter": "multicopter", "plane": "fixed wing", "sub": "submarine", "rover": "rover"}
_BUILDS = {
    1: ("rover", "ArduRover"), 2: ("multicopter", "ArduCopter"), 3: ("fixed wing", "ArduPlane"),
    4: ("antennatracker", "AntennaTracker"), 7: ("submarine", "ArduSub"), 12: ("blimp", "Blimp"),
    13: ("helicopter", "ArduCopter"),
}  # fmt: skip
"""VER.BU: which of ArduPilot's vehicles was built (AP_Vehicle_Type.h)."""
_FIRST_WITH_VER = 4
"""No firmware before 4 writes VER: a lower number is its vendor's own."""
VER_NUMBERS = ("BU", "Maj", "Min", "Pat")
FACTS: Wanted = {"VER": ("FWS", *VER_NUMBERS), "MSG": ("Message",)}
"""What the facts of a DataFlash log are read of."""
WHICH_IS = ", which is "
"""Between the name that a vendor gave its firmware and ArduPilot's."""

GPS_TIME = tuple(name for pair in _GPS_FIELDS for name in pair)
"""Fields of a GPS message that tell the wall clock, week and milliseconds of it: names of firmware 3.2, older ones."""


PARM_FIELDS = ("Name", "Value", "Default")


def history(rows: Iterable[tuple[float, str, float, float | None]], source: str) -> dict[str, tuple[Setting, ...]]:
    """Per parameter its values in time order, out of (time, name, value, default); a value said again is no change."""
    known: dict[str, list[Setting]] = {}
    for t, name, value, default in rows:
        values = known.setdefault(name, [])
        if not values or not is_said_again(values[-1].value, value):
            values.append(Setting(name, value, source, default=default, changed_at_s=t if values else None))
    return {name: tuple(values) for name, values in known.items()}


def parameters_of(table: Table | None, number: Callable[[float], float]) -> dict[str, tuple[Setting, ...]]:
    """The history of PARM records (None: there are none); `number` makes the value that was set of a recorded one."""
    if table is None or not {"Name", "Value"} <= table.columns.keys():
        return {}
    if (table.kind("Name"), table.kind("Value")) != ("text", "number"):  # a broken declaration
        return {}
    has_default = "Default" in table.columns and table.kind("Default") == "number"
    defaults = table["Default"].tolist() if has_default else [np.nan] * len(table)
    references = [number(default) if np.isfinite(default) else None for default in defaults]
    rows = zip(table.t.tolist(), table["Name"].tolist(), map(number, table["Value"].tolist()), references, strict=True)
    return history(rows, "PARM")


def shortest(value: float) -> float:
    """A single-precision number as it was typed: 0.135, not 0.13500000536441803."""
    return float(str(np.float32(value)))


class Built(NamedTuple):
    """What a log's numbers say was built, whatever name its vendor gave it."""

    vehicle: str = ""
    """As in the facts: "multicopter"."""
    firmware: str = ""
    """By ArduPilot's name, with its version where that is told: "ArduCopter 4.5.5"."""


def facts_of(texts: Iterable[str], built: Built = Built()) -> dict[str, str]:  # noqa: B008 - it is frozen
    """`firmware` ("ArduCopter V4.5.4 (fd1bcc61)"), `vehicle` ("multicopter") and `frame` ("QUAD/PLUS") by the texts.

    One that its vendor named is told by what was built: "HawkCopter V4.5.5 (cff126f5), which is ArduCopter 4.5.5".
    """
    facts: dict[str, str] = {}
    vendors = ""
    for text in texts:
        if "firmware" not in facts and (match := _FIRMWARE.match(text)):
            facts["firmware"] = text
            kind = (match[1] or match[0].split()[0]).casefold()
            facts["vehicle"] = _VEHICLES.get(kind, kind)
        elif not vendors and _OTHER_NAME.fullmatch(text):
            vendors = text
        if text.startswith("Frame: "):
            facts.setdefault("frame", text.removeprefix("Frame: "))
    if "firmware" not in facts and (vendors or built.firmware):
        facts["firmware"] = WHICH_IS.join(name for name in (vendors, built.firmware) if name)
    if built.vehicle:
        facts["vehicle"] = built.vehicle
    return facts


def dataflash_facts(tables: Mapping[str, Table], *greetings: str) -> dict[str, str]:
    """The facts by what VER and MSG say, and by the lines before any message."""
    columns = (tables[name].columns.get(field, ()) for name, field in (("VER", "FWS"), ("MSG", "Message"))
               if name in tables)  # fmt: skip
    texts = (str(text) for column in columns for text in column)
    return facts_of((*texts, *greetings), _built(tables["VER"]) if "VER" in tables else Built())


def _built(ver: Table) -> Built:
    """What the first record of VER says was built."""
    if not len(ver) or any(name not in ver.columns or ver.kind(name) != "number" for name in VER_NUMBERS):
        return Built()
    build, *version = (int(ver[name][0]) if np.isfinite(ver[name][0]) else 0 for name in VER_NUMBERS)
    vehicle, name = _BUILDS.get(build, ("", ""))
    is_told = name and version[0] >= _FIRST_WITH_VER
    return Built(vehicle, f"{name} {'.'.join(map(str, version))}" if is_told else name)


def wall_clock(tables: Mapping[str, Table]) -> str | None:
    """ISO 8601 UTC time of second 0 of the log, from the first GPS message that knows its week."""
    gps = tables.get("GPS")
    names = next((pair for pair in _GPS_FIELDS if gps is not None and set(pair) <= gps.columns.keys()), None)
    if gps is None or names is None or any(gps.kind(name) != "number" for name in names):
        return None
    week, milliseconds = (gps[name] for name in names)
    known = gps.where((week > 0) & (week <= _LAST_WEEK) & (milliseconds < _WEEK_MS) & np.isfinite(gps.t))
    if not len(known):
        return None
    fix = _GPS_EPOCH + timedelta(weeks=float(known[names[0]][0]), milliseconds=float(known[names[1]][0]))
    return (fix - timedelta(seconds=float(known.t[0]))).isoformat(timespec="seconds")


def text_of(raw: bytes) -> str:
    """Text up to the first zero byte; bytes that are not UTF-8 are read as Latin-1, so nothing is lost."""
    raw = raw.split(b"\0", 1)[0]
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError:
        return raw.decode("latin-1")

"""A healthy flight of a quad as decoded tables, into which tests plant what fails."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from care_core.ecosystems.ardupilot.examining import READS, find
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.findings import Finding
from care_core.logs.base import Table
from care_core.numbers import Bools, Floats
from care_core.run import Damage, Setting
from tests.tables import TablesLog

ARMED_S, UP_S, DOWN_S, END_S = 5.0, 8.0, 100.0, 110.0
HOVER, HEIGHT_M, SPEED_MS = 0.4, 12.0, 4.0
QUAD_X: Mapping[str, float] = {
    "FRAME_CLASS": 1, "FRAME_TYPE": 1, "MOT_PWM_MIN": 1000, "MOT_PWM_MAX": 2000, "MOT_SPIN_MAX": 0.95,
    "MOT_BAT_VOLT_MAX": 12.8, "BATT_MONITOR": 4, "BATT_LOW_VOLT": 10.5, "COMPASS_ENABLE": 1,
    **{f"SERVO{n}_FUNCTION": 32 + n for n in range(1, 5)},
}  # fmt: skip
FACTS = {"firmware": "ArduCopter V4.5.4 (fd1bcc61)", "vehicle": "multicopter"}
METRE = 1 / 111319.5
"""In degrees."""
RATES = (0.5, 1.0, 2.5, 10.0, 50.0)
FAILS_S = 50.0
"""When what a test plants begins."""
JUMP = Damage("the clock jumps", 0, 40.0, is_jump=True)


def flight_of(
    tables: Mapping[str, Table],
    settings: Mapping[str, tuple[Setting, ...]],
    facts: Mapping[str, str],
    end_s: float = END_S,
    damage: Sequence[Damage] = (),
) -> Flight:
    """The run model of a DataFlash log that holds these tables."""
    flight = Flight(TablesLog(tables, end_s, facts=facts, known=settings, damage=tuple(damage)))
    flight.expect(READS)
    return flight


class Made:
    """The tables of one flight at one rate. `table[name][field]` is changed in place; two instances alternate."""

    def __init__(self, rate_hz: float = 10.0, seed: int = 0) -> None:
        self.rng = np.random.default_rng(seed)
        self.t: Floats = np.arange(0.0, END_S, 1 / rate_hz)
        self.settings = dict(QUAD_X)
        self.defaults: dict[str, float] = {}
        self.facts = dict(FACTS)
        self.table: dict[str, dict[str, Floats]] = {}
        self.rows: dict[str, list[tuple[float, dict[str, float | str]]]] = {
            "ARM": [(ARMED_S, {"ArmState": 1.0, "Forced": 0.0}), (DOWN_S + 5, {"ArmState": 0.0, "Forced": 0.0})],
            "MODE": [(0.0, {"ModeNum": 5.0})],
            "MSG": [(ARMED_S, {"Message": "Arming motors"})],
        }
        self._fly()

    def noise(self, size: float) -> Floats:
        return self.rng.normal(0.0, size, len(self.t))

    def after(self, start_s: float, end_s: float = END_S) -> Bools:
        return (self.t >= start_s) & (self.t <= end_s)

    def lies(self, rows: Bools, lean_deg: float) -> None:
        """Gravity as what lies so far on its right side feels it."""
        lean = np.radians(lean_deg)
        self.table["IMU"]["AccY"][rows], self.table["IMU"]["AccZ"][rows] = 9.8 * np.sin(lean), -9.8 * np.cos(lean)

    def find(self) -> tuple[Finding, ...]:
        return find(self.flight())

    def flight(self) -> Flight:
        return flight_of(self.tables(), self.known, self.facts)

    @property
    def known(self) -> dict[str, tuple[Setting, ...]]:
        """The parameters as a log holds them."""
        return {name: (Setting(name, value, "PARM", self.defaults.get(name)),) for name, value in self.settings.items()}

    def tables(self) -> dict[str, Table]:
        made: dict[str, Table] = {}
        for name, columns in self.table.items():
            pair = self.table.get(f"{name}#2")
            if pair is not None:
                made[name] = self._woven(columns, pair)
            elif not name.endswith("#2"):
                made[name] = Table(self.t, dict(columns))
        for name, rows in self.rows.items():
            ordered = sorted(rows, key=lambda row: row[0])
            columns = {}
            for field in ordered[0][1]:
                kind = object if field in ("Message", "Name") else np.float64
                columns[field] = np.array([row[field] for _, row in ordered], dtype=kind)
            made[name] = Table(np.array([t for t, _ in ordered]), columns)
        return made

    def _woven(self, first: dict[str, Floats], second: dict[str, Floats]) -> Table:
        return Table(
            np.repeat(self.t, 2), {f: np.stack((first[f], second[f]), axis=1).ravel() for f in first if f in second}
        )

    def _fly(self) -> None:
        t, n = self.t, len(self.t)
        up = (t > UP_S) & (t < DOWN_S)
        height = np.interp(t, [UP_S, UP_S + 6, DOWN_S - 12, DOWN_S], [0, HEIGHT_M, HEIGHT_M, 0])
        north = np.interp(t, [20, 60, 90], [0, 40 * SPEED_MS, 40 * SPEED_MS])
        speed = np.where((t > 20) & (t < 60), SPEED_MS, 0.0)
        throttle = np.where(up, HOVER, np.where((t > ARMED_S) & (t < DOWN_S + 5), 0.05, 0.0))
        roll, pitch = np.where(up, self.noise(0.5), 0.0), np.where(up, self.noise(0.5), 0.0)
        yaw = np.interp(t, [30, 70], [10, 200])
        add = self.table
        add["ATT"] = {
            "Roll": roll, "Pitch": pitch, "Yaw": yaw, "DesRoll": roll + self.noise(0.2),
            "DesPitch": pitch + self.noise(0.2), "DesYaw": yaw + self.noise(0.5),
        }  # fmt: skip
        add["CTUN"] = {
            "ThO": throttle, "Alt": height.copy(), "BAlt": height.copy(), "DAlt": height.copy(), "ThI": throttle.copy(),
        }  # fmt: skip
        add["POS"] = {
            "Lat": 47.0 + north * METRE, "Lng": np.full(n, 8.0), "RelHomeAlt": height + self.noise(0.02),
        }  # fmt: skip
        add["RCOU"] = {f"C{k}": 1000 + 950 * throttle + np.where(up, self.noise(8), 0) for k in range(1, 5)}
        for number in ("", "#2"):
            add[f"IMU{number}"] = {
                "I": np.full(n, float(bool(number))),
                **{f"Gyr{a}": np.where(up, self.noise(0.001), 0.0) for a in "XYZ"},
                "AccX": self.noise(0.1), "AccY": self.noise(0.1), "AccZ": -9.8 + self.noise(0.1),
                "GH": np.ones(n), "AH": np.ones(n),
            }  # fmt: skip
            add[f"VIBE{number}"] = {
                "IMU": np.full(n, float(bool(number))),
                **{f"Vibe{a}": np.where(up, 5 + self.noise(0.5), 0.1) for a in "XYZ"}, "Clip": np.zeros(n),
            }  # fmt: skip
            turned = np.radians(yaw)
            add[f"MAG{number}"] = {
                "I": np.full(n, float(bool(number))), "MagX": 220 * np.cos(turned) + self.noise(2),
                "MagY": -220 * np.sin(turned) + self.noise(2), "MagZ": 420 + self.noise(2), "Health": np.ones(n),
            }  # fmt: skip
            add[f"BARO{number}"] = {
                "I": np.full(n, float(bool(number))), "Alt": height + self.noise(0.1), "Health": np.ones(n),
            }  # fmt: skip
        add["GPS"] = {
            "Status": np.full(n, 3.0), "NSats": np.full(n, 14.0), "HDop": np.full(n, 0.8),
            "Lat": 47.0 + (north + self.noise(0.05)) * METRE, "Lng": 8.0 + self.noise(0.05) * METRE,
            "Alt": 400 + height + self.noise(0.3), "Spd": speed, "GCrs": np.zeros(n),
        }  # fmt: skip
        volts = 12.5 - np.where(up, 0.5, 0.0) - np.interp(t, [UP_S, DOWN_S], [0, 0.5])
        add["BAT"] = {"Inst": np.zeros(n), "Volt": volts + self.noise(0.01), "Curr": np.where(up, 20.0, 0.5)}
        add["POWR"] = {"Vcc": 5.0 + self.noise(0.02)}
        add["XKF4"] = {"C": np.zeros(n), **{f: 0.1 + np.abs(self.noise(0.02)) for f in ("SV", "SP", "SH", "SM")}}
        add["PM"] = {"NLon": np.full(n, 2.0), "NL": np.full(n, 4000.0), "Load": np.full(n, 300.0)}


def first(made: Made) -> Finding:
    findings = made.find()
    assert findings, "nothing was found"
    return findings[0]


def falling(made: Made, roll: float, pitch: float) -> None:
    """Control is lost at FAILS_S: it falls to one side within a second, then to the ground, and stays there."""
    t, lost = made.t, made.after(FAILS_S)
    grow = np.clip((t - FAILS_S) / 0.5, 0, 1)[lost]
    made.table["ATT"]["Roll"][lost] = roll * grow
    made.table["ATT"]["Pitch"][lost] = pitch * grow
    ground = np.clip(12.0 - 5 * np.maximum(t - FAILS_S, 0) ** 2, 0, None)
    for name, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt")):
        made.table[name][field][lost] = ground[lost]
    made.rows["ERR"] = [(FAILS_S + 4.0, {"Subsys": 12.0, "ECode": 1.0})]
    made.rows["ARM"][1] = (FAILS_S + 4.0, {"ArmState": 0.0, "Forced": 0.0})

"""A healthy flight of a plane as decoded tables, into which tests plant what fails: two circuits at 60 m."""

from __future__ import annotations

import numpy as np

from tests.flights import DOWN_S, Made

CRUISE_MS, HEIGHT_M, THROTTLE = 20.0, 60.0, 50.0
_RADIUS_M = 120.0


class MadePlane(Made):
    """The tables of a plane that takes off at 10 s, circles to the right at 60 m from 25 s on and is down at 100 s."""

    def __init__(self, rate_hz: float = 10.0, seed: int = 0) -> None:
        super().__init__(rate_hz, seed)
        self.facts = {"firmware": "ArduPlane V4.5.4 (fd1bcc61)"}
        self.settings = {
            "AIRSPEED_MIN": 12, "AIRSPEED_CRUISE": CRUISE_MS, "THR_MAX": 100, "ARSPD_USE": 1, "BATT_MONITOR": 4,
            "TRIM_THROTTLE": THROTTLE, "SERVO1_FUNCTION": 4, "SERVO2_FUNCTION": 19, "SERVO3_FUNCTION": 70,
        }  # fmt: skip
        self.rows["MODE"] = [(0.0, {"ModeNum": 10.0})]
        self._fly_on_wings()

    def _fly_on_wings(self) -> None:
        t, n, add = self.t, len(self.t), self.table
        flies = (t > 10.0) & (t < DOWN_S)
        speed = np.interp(t, [10.0, 16.0, DOWN_S - 4, DOWN_S], [0.0, CRUISE_MS, 16.0, 0.0])
        height = np.interp(t, [10.0, 25.0, DOWN_S - 20, DOWN_S], [0.0, HEIGHT_M, HEIGHT_M, 0.0])
        throttle = np.where(flies, THROTTLE, 0.0)
        turn = np.where((t > 25) & (t < DOWN_S - 20), np.degrees(CRUISE_MS / _RADIUS_M), 0.0)
        yaw = np.cumsum(turn) * (t[1] - t[0])
        north = np.cumsum(speed * np.cos(np.radians(yaw))) * (t[1] - t[0])
        east = np.cumsum(speed * np.sin(np.radians(yaw))) * (t[1] - t[0])
        roll = np.where(turn > 0, 18.0, 0.0) + np.where(flies, self.noise(0.3), 0.0)
        # Each surface moves to and fro, and the rate that answers it goes its way.
        out = 0.1 * np.sin(2 * np.pi * t / 3.0) * flies
        rate = 100.0 * out + np.where(flies, self.noise(0.5), 0.0)
        add["ATT"] |= {"Roll": roll, "DesRoll": roll.copy(), "Yaw": yaw % 360.0, "DesYaw": yaw % 360.0}
        add["CTUN"] = {"ThO": throttle, "As": speed + np.where(flies, self.noise(0.3), 0.0)}
        add["AETR"] = {"Ail": 4500 * out, "Elev": 4500 * out, "Thr": throttle.copy()}
        for channel in ("PIDR", "PIDP"):
            add[channel] = {"Tar": rate + self.noise(0.2), "Act": rate.copy()}
        add["ARSP"] = {"Airspeed": add["CTUN"]["As"].copy(), "U": np.ones(n), "H": np.ones(n)}
        metre = 1 / 111319.5
        place = {"Lat": 47.0 + north * metre, "Lng": 8.0 + east * metre / np.cos(np.radians(47.0))}
        add["POS"] = {**place, "RelHomeAlt": height + self.noise(0.02)}
        add["GPS"] |= {**{name: at + self.noise(0.05) * metre for name, at in place.items()},
                       "Alt": 400 + height + self.noise(0.3), "Spd": speed}  # fmt: skip
        for number in ("", "#2"):
            add[f"BARO{number}"]["Alt"] = height + self.noise(0.1)
        add["BAT"] = {**add.get("BAT", {}),
                      "Volt": 12.6 - 0.01 * throttle + self.noise(0.01),
                      "Curr": 20.0 * (throttle / 50.0) ** 2 + flies * np.abs(self.noise(0.2))}  # fmt: skip
        add["RCOU"] = {
            "C1": 1500 + 400 * out,
            "C2": 1500 + 400 * out,
            "C3": 1000 + 10 * throttle,
            "C4": np.full(n, 1500.0),
        }
        add.pop("RATE", None)

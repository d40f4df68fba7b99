"""A multicopter that hovers until something happens to it, simulated as a rigid body under its own controller, and its
log as PX4 or ArduPilot writes one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from care_core.ecosystems.vehicles import Motor, motors_of
from care_core.logs import formats
from care_core.logs.base import Table
from care_core.numbers import Floats
from care_core.run import Setting
from tests.tables import TablesLog

STEP_S, END_S, FAILS_S, HEIGHT_M = 0.004, 30.0, 20.0, 12.0
ARMED_S, HOVER, TURN_S = 5.0, 0.45, 0.02
_G, _KP, _KD, _KYAW = 9.81, 6.0, 1.4, 0.4
_INERTIA = np.array([60.0, 60.0, 3.0])
"""Angular acceleration (rad/s^2) of the whole range of one motor at the end of an arm, and by its drag."""

Event = Callable[[float, Floats], Floats]
"""From the time and what each motor gives (shares of its most) to what it gives after what happened."""


class Fall(NamedTuple):
    """What a simulated flight was, at 50 Hz; `asked` has the shape (motors, n), `quaternion` (n, 4)."""

    t: Floats
    quaternion: Floats
    asked: Floats
    height: Floats
    felt: Floats
    down_s: float | None


def frame(frame_class: int, frame_type: int) -> tuple[Motor, ...]:
    """The motors of an ArduPilot frame."""
    return motors_of({"FRAME_CLASS": frame_class, "FRAME_TYPE": frame_type})


def efficiency(motor: int, share: float, at: float = FAILS_S) -> Event:
    """A motor, by its number, that gives a share of its thrust from a time on."""

    def cut(t: float, given: Floats) -> Floats:
        given = given.copy()
        if t >= at:
            given[motor - 1] *= share
        return given

    return cut


def fly(
    motors: Sequence[Motor], event: Event, kick: Callable[[float], Floats] = lambda t: np.zeros(3), seed: int = 0
) -> Fall:
    """A hover with the event and a kick (rad/s^2 about three axes); it lies where it hit the ground."""
    rng = np.random.default_rng(seed)
    mix = np.array([[motor.roll, motor.pitch, motor.yaw] for motor in motors]).T
    turning = mix * _INERTIA[:, None]
    allocate = np.linalg.pinv(turning)
    turned, rates, height, climb = np.eye(3), np.zeros(3), 0.0, 0.0
    rows: list[tuple[float, Floats, Floats, float, float]] = []
    down_s, given = None, np.zeros(len(motors))
    for t in np.arange(0.0, END_S, STEP_S):
        asked = np.zeros(len(motors))
        if t >= ARMED_S and (down_s is None or t < down_s + 1.0):
            wanted = HEIGHT_M if t < END_S - 1 else 0.0
            lift = min(max(HOVER + 0.03 * (wanted - height) - 0.06 * climb, 0.1), 0.9)
            down = turned[2]
            torque = np.array([-_KP * down[1], _KP * down[0], 0.0]) * 8 - _KD * 8 * rates
            torque[2] = -_KYAW * 8 * rates[2]
            wanted_of_each = lift + allocate @ torque + rng.normal(0, 0.004, len(motors))
            asked = np.minimum(np.maximum(wanted_of_each, 0.0), 1.0)
        given += (asked - given) * min(STEP_S / TURN_S, 1.0)
        gives = event(float(t), given)
        force = gives.mean() / HOVER * _G
        rates = rates + STEP_S * (turning @ gives + kick(float(t)) - 0.3 * rates)
        speed, felt = climb, force
        climb += STEP_S * (turned[2, 2] * force - _G)
        height += STEP_S * climb
        if height <= 0.0:
            if t > ARMED_S + 5 and down_s is None:
                down_s = float(t)
                felt = 40.0 * max(-speed, 0.0)
            height, climb, rates = 0.0, max(climb, 0.0), rates * (0.0 if down_s is not None else 1.0)
            felt = max(felt, _G)
        p, q, r = rates * STEP_S
        turned = turned @ np.array([[1, -r, q], [r, 1, -p], [-q, p, 1]])
        if len(rows) % 10 == 0 or abs(rates).max() > 3:
            u, _, v = np.linalg.svd(turned)
            turned = u @ v
        rows.append((t, turned.copy(), asked, height, felt))
    kept = rows[::5]
    blows = [max(row[4] for row in rows[n * 5 : n * 5 + 5]) for n in range(len(kept))]
    return Fall(
        np.array([row[0] for row in kept]),
        np.array([_quaternion(row[1]) for row in kept]),
        np.array([row[2] for row in kept]).T,
        np.array([row[3] for row in kept]),
        np.array(blows),
        down_s,
    )


def _quaternion(turned: Floats) -> tuple[float, float, float, float]:
    """w, x, y, z of a rotation matrix from body to world."""
    w = 0.5 * np.sqrt(max(1 + np.trace(turned), 1e-12))
    if w > 1e-3:
        x, y, z = turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]
        return w, x / (4 * w), y / (4 * w), z / (4 * w)
    axis = int(np.argmax(np.diag(turned)))
    vector = (turned[:, axis] + np.eye(3)[axis]) / np.sqrt(2 * (1 + turned[axis, axis]))
    return 0.0, float(vector[0]), float(vector[1]), float(vector[2])


def settings(values: Mapping[str, float], *changed: Setting) -> dict[str, tuple[Setting, ...]]:
    """Parameters as a log holds them, with those that changed."""
    known: dict[str, tuple[Setting, ...]] = {name: (Setting(name, value, "log"),) for name, value in values.items()}
    for one in changed:
        known[one.name] = (*known.get(one.name, ()), one)
    return known


def px4_log(
    fall: Fall, parameters: Mapping[str, tuple[Setting, ...]], mode: float = 2.0, every: int = 5, pwm: bool = True,
    **replaced: Table,
) -> TablesLog:  # fmt: skip
    """The ULog of a flight; outputs at 10 Hz unless told otherwise."""
    t, count, rng = fall.t, len(fall.asked), np.random.default_rng(0)
    armed_until = END_S if fall.down_s is None else fall.down_s + 1.0
    landed = (t < ARMED_S + 2) | (t > armed_until)
    level = np.tile(np.array([1.0, 0.0, 0.0, 0.0]), (len(t), 1))
    tables = {
        "vehicle_status": Table(t, {
            "arming_state": np.where((t >= ARMED_S) & (t < armed_until), 2.0, 1.0), "nav_state": np.full(len(t), mode),
            "vehicle_type": np.ones(len(t)), "failsafe": np.zeros(len(t)),
        }),
        "vehicle_land_detected": Table(t, {"landed": landed.astype(float)}),
        "vehicle_local_position": Table(t, {"z": -fall.height}),
        "vehicle_attitude": Table(t, {f"q[{n}]": fall.quaternion[:, n] for n in range(4)}),
        "vehicle_attitude_setpoint": Table(t, {f"q_d[{n}]": level[:, n] for n in range(4)}),
        "sensor_combined": Table(t, {
            **{f"gyro_rad[{n}]": rng.normal(0.0, 0.01, len(t)) for n in range(3)},
            **{f"accelerometer_m_s2[{n}]": -fall.felt if n == 2 else rng.normal(0.0, 0.1, len(t)) for n in range(3)},
        }),
    }  # fmt: skip
    if pwm:
        outputs = {f"output[{n}]": (1000 + 1000 * fall.asked[n])[::every] for n in range(count)}
        outputs |= {f"output[{n}]": np.full(len(t[::every]), 1500.0) for n in range(count, 8)}
        tables["actuator_outputs"] = Table(t[::every], outputs)
    else:
        tables["actuator_motors"] = Table(t[::every], {f"control[{n}]": fall.asked[n][::every] for n in range(count)})
    facts = {"stack": "PX4", "firmware": "PX4 v1.15.0 (cb09dde6)", "vehicle": "multicopter"}
    return TablesLog({**tables, **replaced}, END_S, formats.PX4_ULG, facts, parameters)


def dataflash_log(
    fall: Fall, motors: Sequence[Motor], parameters: Mapping[str, tuple[Setting, ...]], mode: float = 5.0,
    every: int = 5, messages: Sequence[tuple[float, str]] = (),
) -> TablesLog:  # fmt: skip
    """The DataFlash log of a flight; its records at 10 Hz unless told otherwise."""
    w, x, y, z = fall.quaternion[::every].T
    t = fall.t[::every]
    roll = np.degrees(np.arctan2(2 * (w * x + y * z), 1 - 2 * (x**2 + y**2)))
    pitch = np.degrees(np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0)))
    armed_until = END_S - 0.5 if fall.down_s is None else min(fall.down_s + 1.0, END_S - 0.5)
    height, nothing = fall.height[::every], np.zeros(len(t))
    said = [(ARMED_S, "Arming motors"), *messages]
    tables = {
        "ATT": Table(t, {"Roll": roll, "Pitch": pitch, "Yaw": nothing, "DesRoll": nothing, "DesPitch": nothing,
                         "DesYaw": nothing}),
        "CTUN": Table(t, {"ThO": fall.asked.mean(axis=0)[::every], "Alt": height, "BAlt": height, "DAlt": height}),
        "POS": Table(t, {"Lat": np.full(len(t), 47.0), "Lng": np.full(len(t), 8.0), "RelHomeAlt": height}),
        "RCOU": Table(t, {f"C{motor.output}": (1000 + 1000 * row)[::every]
                          for motor, row in zip(motors, fall.asked, strict=True)}),
        "IMU": Table(fall.t, {"I": np.zeros(len(fall.t)), "AccX": np.zeros(len(fall.t)),
                              "AccY": np.zeros(len(fall.t)), "AccZ": -fall.felt}),
        "MODE": Table(np.zeros(1), {"ModeNum": np.array([mode])}),
        "ARM": Table(np.array([ARMED_S, armed_until]), {"ArmState": np.array([1.0, 0.0]), "Forced": np.zeros(2)}),
        "MSG": Table(np.array([at for at, _ in said]), {"Message": np.array([text for _, text in said], object)}),
    }  # fmt: skip
    facts = {"firmware": "ArduCopter V4.5.4 (fd1bcc61)", "vehicle": "multicopter"}
    return TablesLog(tables, END_S, facts=facts, known=parameters)

"""Rotors that are described as no multicopter is built, and motors that no output drives.

Control allocation shares lift and torque among the motors by where each rotor sits, which way it turns and how much it
lifts (CA_ROTORn_*; ActuatorEffectivenessRotors.cpp). Where the description does not balance, it asks of the motors what
the vehicle cannot do: it does not rise, or turns over. An output drives the motor that its function names (101 and on).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.px4.flight import MESSAGES, Px4Flight
from care_core.ecosystems.vehicles.settings import code, number
from care_core.logs.base import Wanted
from care_core.numbers import Floats
from care_core.run import Setting, shown
from care_core.text import listed

READS: Wanted = {MESSAGES: ("message",)}
LIMITS = Limits()
_OFF_CENTRE = LIMITS.add("lift off the middle, as a share of the arms", 0.3, "", "a choice: a frame is nearly even")
_ODD = LIMITS.add(
    "ratio of one rotor's lift to each of the others'", 1.5, "", "a choice: frames have alike rotors, or pairs"
)
_ALIKE = LIMITS.add("spread of the others' lift", 0.1, "", "a choice: alike")
_TILTED = LIMITS.add("tilt of one rotor alone", 0.1, "", "a choice: 6 degrees; frames tilt all of theirs")
_SURE_P = LIMITS.add("probability of the parameter", 0.95, "", "no frame is built so")
_MULTIROTOR = 0
"""CA_AIRFRAME of all multicopters."""
_FIELDS = ("PX", "PY", "AX", "AY", "AZ", "KM", "CT")
_FIRST_MOTOR = 101
_NO_FRAME = re.compile(r"actuator effectiveness (init failed|.*null)", re.IGNORECASE)
_OUTPUT = re.compile(r"(PWM|HIL|UAVCAN|PCA|VOXL|TAP|MODAL|SIM)\w*_FUNC\d+")

Rotors = Mapping[str, Sequence[float]]


def find(flight: Px4Flight) -> Iterator[Finding]:
    """What a multicopter that was armed is told of its rotors and outputs, where it cannot be."""
    settings = flight.log.settings()
    count = code(settings, "CA_ROTOR_COUNT") or 0
    if flight.armed:
        yield from _without_frame(flight)
    if not flight.armed or count < 4 or code(settings, "CA_AIRFRAME") != _MULTIROTOR:
        return
    told = {field: [number(settings, f"CA_ROTOR{n}_{field}") for n in range(count)] for field in _FIELDS}
    rotors = {field: [one for one in values if one is not None] for field, values in told.items()}
    if all(len(values) == count for values in rotors.values()):
        wrong = dict(_unbalanced(rotors))
        names = [f"CA_ROTOR{n}_{field}" for fields in wrong.values() for field in fields for n in range(count)]
        if off := _off(names, flight):
            yield _finding(flight, "the rotors that it is told of do not balance", listed(list(wrong)), off)
    yield from _undriven(flight, settings, count)


def _unbalanced(rotors: Rotors) -> Iterator[tuple[str, tuple[str, ...]]]:
    """What is wrong with a set of rotors, and by which of their fields."""
    x, y, lift, turn = (np.array(rotors[field]) for field in ("PX", "PY", "CT", "KM"))
    arm = float(np.mean(np.hypot(x, y)))
    if (lift <= 0).any():
        yield "a rotor that lifts nothing, or downwards", ("CT",)
    elif np.hypot(np.sum(lift * x), np.sum(lift * y)) / np.sum(lift) > _OFF_CENTRE * arm:
        yield f"lift off the middle by more than {_OFF_CENTRE:g} of the arms of {arm:.2g} m", ("PX", "PY", "CT")
    elif (share := _odd_one(lift)) is not None:
        yield f"one rotor that lifts {share:.2g} times as much as each of the others", ("CT",)
    if (
        len(turn) % 2 == 0
        and np.allclose(np.abs(turn), np.abs(turn[0]), rtol=0.01)
        and (turn > 0).sum() * 2 != len(turn)
    ):
        yield f"{(turn > 0).sum()} rotors that turn one way and {(turn < 0).sum()} the other", ("KM",)
    if len({bool(one > 0) for one in rotors["AZ"]}) > 1:
        yield "rotors that lift up and down", ("AZ",)
    if sum(max(abs(a), abs(b)) > _TILTED for a, b in zip(rotors["AX"], rotors["AY"], strict=True)) == 1:
        yield "one rotor that is tilted", ("AX", "AY")


def _odd_one(lift: Floats) -> float | None:
    """How many times what each of the others lifts one rotor alone does; None where none stands out."""
    shares = lift / np.median(lift)
    odd = (shares > _ODD) | (shares < 1 / _ODD)
    rest = shares[~odd]
    return float(shares[odd][0]) if odd.sum() == 1 and np.ptp(rest) < _ALIKE else None


def _without_frame(flight: Px4Flight) -> Iterator[Finding]:
    """A frame that control allocation does not know: it commands no motor."""
    said = next((text for _, _, text in flight.messages if _NO_FRAME.search(text)), None)
    if said is not None and (off := _off(["CA_AIRFRAME"], flight)):
        yield _finding(flight, "control allocation knows no such frame", f"'{said}'", off)


def _undriven(flight: Px4Flight, settings: Mapping[str, tuple[Setting, ...]], count: int) -> Iterator[Finding]:
    """Motors that no output drives, where others are driven."""
    functions = {name: code(settings, name) for name in settings if _OUTPUT.fullmatch(name)}
    driven = {one - _FIRST_MOTOR for one in functions.values() if one is not None}
    missing = [n for n in range(count) if n not in driven]
    if not missing or len(missing) == count:
        return
    off = _off(list(functions), flight)
    taken = {name: one for name, one in off.items() if one.default in [_FIRST_MOTOR + n for n in missing]}
    taken = taken or _off(["CA_ROTOR_COUNT"], flight)
    if taken:
        motors = listed([f"motor {n + 1}" for n in missing])
        yield _finding(
            flight, f"no output drives {motors}", f"{len(driven & set(range(count)))} of {count} are driven", taken
        )


def _off(names: Sequence[str], flight: Px4Flight) -> dict[str, Setting]:
    """The parameters that are not at their airframe's defaults, as far as the log holds these."""
    return {name: one for name in names if (one := flight.off_default(name)) is not None}


def _finding(flight: Px4Flight, title: str, evidence: str, off: Mapping[str, Setting]) -> Finding:
    values = "; ".join(f"{one.name} is {shown(one.value)} (default {shown(one.default)})" for one in off.values())
    start, end = flight.armed[0]
    return Finding(
        kind="motor",
        title=title,
        onset_s=start,
        end_s=end,
        severity="critical",
        evidence=f"{evidence}: {values}",
        source="parameters CA_ROTORn_* and the functions of the outputs",
        suspect="parameter",
        probability=_SURE_P,
        parameters=tuple(off),
        wanted=tuple((name, float(one.default)) for name, one in off.items() if isinstance(one.default, (int, float))),
    )


CHECK = Check("rotors", "rotors that are described as they cannot balance, and motors without an output", READS, LIMITS,
              find)  # fmt: skip

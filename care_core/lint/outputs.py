"""What a vehicle's inputs and outputs are mapped to: sticks and switches that share a channel, motors without an
output, ports that two want."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from itertools import combinations

import numpy as np

from care_core.lint.problems import Entry, LintedFile, Problem
from care_core.metadata.output_functions import LEFT, MOTORS, MOTORS_OF_FRAME, RIGHT, STEERING, THROTTLE

Values = Mapping[str, Entry]

_HALVES = (
    (THROTTLE, STEERING, "SERVO1_FUNCTION", f"steering ({STEERING})"),
    (STEERING, THROTTLE, "SERVO3_FUNCTION", f"throttle ({THROTTLE})"),
    (LEFT, RIGHT, "", f"the right side ({RIGHT})"), (RIGHT, LEFT, "", f"the left side ({LEFT})"),
)  # fmt: skip
"""Functions of which one goes with the other, and the output that has that one where the file leaves it at 0."""
_OUTPUTS = range(1, 15)
"""Outputs that every release lists: a file without all of them is an extract."""
_SERIAL_GPS = (1, 2, 5, 6, 8, 10, 11, 13, 15, 16, 17, 18, 20, 24, 25, 26)
"""Receivers that are read from a serial port (AP_GPS.h)."""
_GPS_PROTOCOL = 5
_LEAST_PORTS = 3
_NOTCHES = ("INS_HNTCH_", "INS_HNTC2_")
_MOVED = 0.52
"""HarmonicNotchFilter.cpp keeps the centre above this share of the bandwidth."""
_FOLLOWING = (2, 3, 4, 5)
"""INS_HNTCH_MODE: a rotor's speed, ESCs, spectra."""
_HEIGHTS = {"RTL_ALT": 0.01, "RTL_ALT_M": 1.0, "ALT_HOLD_RTL": 0.01, "RTL_ALTITUDE": 1.0}
"""Heights to come home at, and what makes metres of them."""
_PX4_ALONE = (
    "RC_MAP_ROLL", "RC_MAP_PITCH", "RC_MAP_THROTTLE", "RC_MAP_YAW", "RC_MAP_KILL_SW", "RC_MAP_ARM_SW",
)  # fmt: skip
_PX4_MAPPED = re.compile(r"RC_MAP_(ROLL|PITCH|THROTTLE|YAW|FLTMODE|\w+_SW)")
_PX4_FUNCTION = re.compile(r"(PWM_MAIN|PWM_AUX|UAVCAN_EC|PCA9685)_FUNC\d+")
_PX4_PORT = re.compile(r"\w+_(CONFIG|CFG)")
_PORTS = range(100, 500)
"""Serial ports by their index (generate_config.py); 1000 is Ethernet, which several share."""
_PX4_MOTORS = range(101, 113)
_LEAST_ROTORS = 4
_SMALL = 1e-3
_ALLOCATION = "PX4/PX4-Autopilot #23606; ActuatorEffectivenessRotors.cpp"
_HEIGHT_SOURCES = {
    0: ("EKF2_BARO_CTRL", 1, "the barometer"), 1: ("EKF2_GPS_CTRL", 2, "the height of GPS"),
    3: ("EKF2_EV_CTRL", 2, "the height of external vision"),
}  # fmt: skip
"""By EKF2_HGT_REF: the switch of what it names, and its bit."""


def _whole(values: Values, name: str) -> int | None:
    number = values[name].number if name in values else None
    return int(number) if number is not None and float(number).is_integer() else None


def _warning(file: LintedFile, entry: Entry, text: str, hint: str, source: str, *others: Entry) -> Problem:
    return file.warning("contradiction", entry, text, hint, source, others)


# ArduPilot


def ardupilot(file: LintedFile, values: Values) -> Iterator[Problem]:
    """Channels, outputs and ports of an ArduPilot vehicle."""
    yield from _sticks(file, values)
    yield from _options(file, values)
    yield from _motors(file, values)
    yield from _wheels(file, values)
    yield from _receiver(file, values)
    yield from _notches(file, values)
    yield from _fenced(file, values)


def _sticks(file: LintedFile, values: Values) -> Iterator[Problem]:
    mapped = [entry for name, entry in values.items() if name.startswith("RCMAP_") and entry.number]
    for one, other in combinations(mapped, 2):
        if one.number == other.number:
            text = f"{one.name} and {other.name} are both channel {one.number:g}: one stick moves both."
            yield _warning(file, other, text, "Give each its own channel.", "RCMapper of ArduPilot", one)


def _options(file: LintedFile, values: Values) -> Iterator[Problem]:
    """Two switches of one option, and an option on the channel that chooses the mode: it refuses to arm."""
    found: dict[int, Entry] = {}
    source = "AP_Arming.cpp, rc_arm_checks"
    for number in range(1, 17):
        option = _whole(values, f"RC{number}_OPTION")
        if not option:
            continue
        entry = values[f"RC{number}_OPTION"]
        if option in found:
            text = f"{found[option].name} and {entry.name} are both {option}: it refuses to arm."
            yield _warning(file, entry, text, "Leave one of the two at 0.", source, found[option])
        found.setdefault(option, entry)
        for name in ("FLTMODE_CH", "MODE_CH"):
            if _whole(values, name) == number:
                text = f"{entry.name} is {option}, and {name} chooses the mode by that channel: it refuses to arm."
                yield _warning(file, entry, text, "Set one of them to another channel.", source, values[name])


def _motors(file: LintedFile, values: Values) -> Iterator[Problem]:
    """Motors of a frame that no output drives."""
    outputs = {name: entry for name, entry in values.items() if re.fullmatch(r"SERVO\d+_FUNCTION", name)}
    driven = Counter(int(entry.number or 0) for entry in outputs.values())
    is_plane = _whole(values, "Q_ENABLE") == 1
    frame = _whole(values, "Q_FRAME_CLASS" if is_plane else "FRAME_CLASS")
    wanted = tuple(MOTORS.values())[: MOTORS_OF_FRAME.get(frame or 0, 0)]
    if not ("MOT_SPIN_ARM" in values or is_plane) or not any(driven[one] for one in wanted):
        return
    missing = [place for place, function in enumerate(wanted, start=1) if not driven[function]]
    twice = [entry for entry in outputs.values() if driven[int(entry.number or 0)] > 1 and entry.number in wanted]
    if missing and twice:
        again = " and ".join(one.name for one in twice)
        text = f"{again} are both {twice[0].number:g}, and no output drives motor {', '.join(map(str, missing))}: "
        text += "it refuses to arm."
        hint = f"Motor {missing[0]} is function {wanted[missing[0] - 1]}."
        yield _warning(file, twice[-1], text, hint, "AP_Motors_Class.cpp: each motor needs an output", *twice[:-1])
    elif missing and all(f"SERVO{number}_FUNCTION" in values for number in _OUTPUTS):
        text = f"No output drives motor {', '.join(map(str, missing))} of this frame: since 4.3 it refuses to arm."
        hint = f"Motor {missing[0]} is function {wanted[missing[0] - 1]} of its SERVOn_FUNCTION."
        entry = values["Q_FRAME_CLASS" if is_plane else "FRAME_CLASS"]
        yield _warning(file, entry, text, hint, "AP_MotorsMatrix.cpp, arming_checks: each motor needs an output")


def _wheels(file: LintedFile, values: Values) -> Iterator[Problem]:
    """Rovers with half of what steers and drives them."""
    outputs = [entry for name, entry in values.items() if re.fullmatch(r"SERVO\d+_FUNCTION", name)]
    held = {int(entry.number or 0): entry for entry in outputs}
    if "CRUISE_SPEED" not in values or "ATC_STR_RAT_P" not in values or not outputs:
        return
    for one, other, usual, what in _HALVES:
        is_taken = not usual or bool(_whole(values, usual))
        if one in held and other not in held and is_taken and _whole(values, "SAIL_ENABLE") != 1:
            text = f"{held[one].name} is {one}, and no output has {what}: it refuses to arm."
            hint = "Assign the other as well."
            if {LEFT, RIGHT} <= set(held):
                hint = f"Set it to 0: {LEFT} and {RIGHT} drive and steer."
            yield _warning(file, held[one], text, hint, "AP_MotorsUGV.cpp, pre_arm_check")


def _receiver(file: LintedFile, values: Values) -> Iterator[Problem]:
    """A GPS that no port listens to."""
    ports = [entry for name, entry in values.items() if re.fullmatch(r"SERIAL[1-9]_PROTOCOL", name)]
    name = "GPS1_TYPE" if "GPS1_TYPE" in values else "GPS_TYPE"
    if len(ports) < _LEAST_PORTS or _whole(values, name) not in _SERIAL_GPS:
        return
    if not any(entry.number == _GPS_PROTOCOL for entry in ports):
        text = f"{name} is {values[name].number:g}, and no SERIALn_PROTOCOL is {_GPS_PROTOCOL}: no port listens to it."
        hint = f"Set that of its port to {_GPS_PROTOCOL}."
        yield _warning(file, values[name], text, hint, "AP_SerialManager: ports are given by their protocol")


def _notches(file: LintedFile, values: Values) -> Iterator[Problem]:
    for prefix in _NOTCHES:
        centre, width, reference = (values.get(f"{prefix}{name}") for name in ("FREQ", "BW", "REF"))
        if _whole(values, f"{prefix}ENABLE") != 1 or centre is None or width is None:
            continue
        if 0 < (centre.number or 0.0) < _MOVED * (width.number or 0.0):
            text = f"{width.name} ({width.number:g} Hz) is about twice {centre.name} ({centre.number:g} Hz) or more: "
            text += "the firmware moves the notch up."
            hint = "Half of the frequency is usual."
            yield _warning(file, width, text, hint, "HarmonicNotchFilter.cpp, init", centre)
        if reference is not None and reference.number == 0 and _whole(values, f"{prefix}MODE") in _FOLLOWING:
            text = f"{reference.name} is 0: the notch stays at {centre.name}, whatever {prefix}MODE is to follow."
            mode = values[f"{prefix}MODE"]
            yield _warning(file, reference, text, "1 follows it.", "AP_Vehicle.cpp, update_dynamic_notch", mode)


def _fenced(file: LintedFile, values: Values) -> Iterator[Problem]:
    """Heights to come home at above the fence: it comes home no higher than that."""
    top, kinds = values.get("FENCE_ALT_MAX"), _whole(values, "FENCE_TYPE")
    if top is None or not top.number or _whole(values, "FENCE_ENABLE") != 1 or kinds is None or not kinds & 1:
        return
    for name, metres in _HEIGHTS.items():
        entry = values.get(name)
        if entry is not None and entry.number is not None and entry.number * metres > top.number:
            text = f"{name} is {entry.number * metres:g} m, above the fence (FENCE_ALT_MAX {top.number:g} m)."
            hint = "Coming home, it stays below the fence: raise that, or lower the other."
            yield _warning(file, entry, text, hint, "ArduPilot keeps below the fence where it comes home", top)


# PX4


def px4(file: LintedFile, values: Values) -> Iterator[Problem]:
    """Channels, outputs, ports and height sources of a PX4 vehicle."""
    yield from _px4_channels(file, values)
    yield from _px4_motors(file, values)
    yield from _px4_rotors(file, values)
    yield from _px4_ports(file, values)
    yield from _px4_height(file, values)


def _px4_channels(file: LintedFile, values: Values) -> Iterator[Problem]:
    """Sticks, and switches that arm or kill, that share a channel; modes may share one, by their thresholds."""
    used: dict[float, Entry] = {}
    for name in sorted((one for one in values if _PX4_MAPPED.fullmatch(one)), key=_PX4_ALONE.__contains__):
        entry = values[name]
        if not entry.number:
            continue
        earlier = used.setdefault(entry.number, entry)
        if earlier is not entry and name in _PX4_ALONE:
            text = f"{earlier.name} and {name} are both channel {entry.number:g}: one moves with the other."
            yield _warning(file, entry, text, "Give each its own channel.", "rc_update.cpp of PX4", earlier)


def _px4_motors(file: LintedFile, values: Values) -> Iterator[Problem]:
    outputs = [entry for name, entry in values.items() if _PX4_FUNCTION.fullmatch(name)]
    driven = Counter(int(entry.number or 0) for entry in outputs)
    count = _whole(values, "CA_ROTOR_COUNT") or 0
    if not any(driven[one] for one in _PX4_MOTORS):
        return
    missing = [one - 100 for one in _PX4_MOTORS[:count] if not driven[one]]
    twice = [entry for entry in outputs if driven[int(entry.number or 0)] > 1 and entry.number in _PX4_MOTORS]
    source = "PX4's documentation of actuators"
    if missing:
        text = f"CA_ROTOR_COUNT is {count}, and no output drives motor {', '.join(map(str, missing))}."
        hint = f"Motor {missing[0]} is function {missing[0] + 100}."
        yield _warning(file, values["CA_ROTOR_COUNT"], text, hint, source, *twice)
    for number in dict.fromkeys(entry.number for entry in twice):
        first, *more = (entry for entry in twice if entry.number == number)
        text = f"{' and '.join(one.name for one in (first, *more))} both drive motor {int(number or 0) - 100}."
        hint = "Leave one of them out, unless two ESCs are meant."
        yield file.note("contradiction", first, text, hint, source, more)


def _px4_rotors(file: LintedFile, values: Values) -> Iterator[Problem]:
    """Rotors of a multicopter that all stand in one line, pairs of them at one place."""
    count = _whole(values, "CA_ROTOR_COUNT") or 0
    if _whole(values, "CA_AIRFRAME") or count < _LEAST_ROTORS:
        return
    places = [(values.get(f"CA_ROTOR{one}_PX"), values.get(f"CA_ROTOR{one}_PY")) for one in range(count)]
    numbers = [(x.number or 0.0, y.number or 0.0, 1.0) for x, y in places if x is not None and y is not None]
    if len(numbers) < count or any(_is_tilted(values, one) for one in range(count)):
        return
    rows = np.array(numbers)
    if np.linalg.matrix_rank(rows / np.maximum(np.abs(rows).max(axis=0), _SMALL), tol=_SMALL) < rows.shape[1]:
        text = "The rotors stand in a line: roll, pitch and thrust cannot be set apart from each other."
        hint = "Check where CA_ROTORn_PX and PY put them, forwards and to the right."
        yield file.warning("cannot-work", values["CA_ROTOR_COUNT"], text, hint, _ALLOCATION)


def _is_tilted(values: Values, rotor: int) -> bool:
    axis = [values.get(f"CA_ROTOR{rotor}_A{one}") for one in "XY"]
    return any(entry is not None and entry.number for entry in axis)


def _px4_ports(file: LintedFile, values: Values) -> Iterator[Problem]:
    used: dict[int, Entry] = {}
    for name, entry in values.items():
        port = _whole(values, name)
        if port is None or port not in _PORTS or not _PX4_PORT.fullmatch(name) or name.startswith("SYS_"):
            continue
        earlier = used.setdefault(port, entry)
        if earlier is not entry:
            text = f"{earlier.name} and {name} are both port {port}: only the first that starts has it."
            yield _warning(file, entry, text, "Give each its own port.", "rc.serial_port of PX4", earlier)


def _px4_height(file: LintedFile, values: Values) -> Iterator[Problem]:
    reference = _whole(values, "EKF2_HGT_REF")
    switch, bit, what = _HEIGHT_SOURCES.get(-1 if reference is None else reference, ("", 0, ""))
    held = _whole(values, switch)
    if held is not None and not held & bit:
        text = f"EKF2_HGT_REF is {reference}, and {switch} leaves {what} out: EKF2 switches it on as it starts."
        hint = f"Add {bit} to {switch}, or take another reference."
        entry = values["EKF2_HGT_REF"]
        yield file.note("contradiction", entry, text, hint, "EKF2.cpp, VerifyParams", [values[switch]])

"""Which parameters a refusal to arm is about: what its check reads, where that is off its default or cannot hold."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

from care_core.ecosystems.ardupilot.checks.settings.supply import wrong_scale
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.texts import Refusal
from care_core.ecosystems.base import Limits
from care_core.ecosystems.lithium import CHARGED_V, HARMED_V
from care_core.ecosystems.way_back import way_back
from care_core.metadata.ardupilot import firmware_default
from care_core.metadata.causal_map import OF_THIS_VEHICLE, SET_BY_HAND, Role, meaning_of
from care_core.metadata.output_functions import MOTORS, MOTORS_OF_FRAME, OUTPUTS
from care_core.metadata.refusals import Must, refusal_reads
from care_core.run import Setting

LIMITS = Limits()
PROVEN = LIMITS.add(
    "probability of a parameter that cannot hold", 0.9, "", "the text names it, or it breaks what the check asks"
)
OFF = LIMITS.add(
    "probability of the parameters off their default", 0.8, "", "a choice: they are all that this check reads"
)
PLAUSIBLE = LIMITS.add(
    "probability of a parameter that cannot hold, where surroundings bring such a refusal",
    0.8,
    "",
    "a choice: a little less than where nothing else can be",
)
OUTSIDE = LIMITS.add(
    "share of that where surroundings bring such a refusal", 0.5, "", "a choice: the log tells neither from the other"
)
_REPEATED_S = LIMITS.add(
    "how long before the last a refusal counts", 30.0, "s", "AP_Arming repeats complaints every 30 s"
)
_ONE_ROUND_S = LIMITS.add("time in which one attempt tells its refusals", 1.0, "s", "a choice: texts wait for a link")
_PASSED = LIMITS.add("attempts without a refusal that had passed", 3.0, "", "a choice: texts can be lost")
MOST = LIMITS.add("parameters off their default that are put back", 3.0, "", "a choice: more are how it is wired")
_FAR = LIMITS.add(
    "far off its default", 1.5, "times", "a choice: what is tuned is seldom off by more and fails a check"
)
_CODES = LIMITS.add("greatest default of a code", 10.0, "", "a choice: another code is another choice, however near")
_FULL_AT = LIMITS.add("cell that reads full", CHARGED_V, "V", "voltages of lithium polymer cells")
_NONE_AT = LIMITS.add("cell that no pack has", HARMED_V, "V", "voltages of lithium polymer cells")
_MOTOR = re.compile(r"no SERVOx_FUNCTION set to Motor(\d+)")
_STEERS = re.compile(r"steering and throttle config", re.IGNORECASE)
_STEERING_AND_THROTTLE = (26.0, 70.0)
"""SERVOn_FUNCTION of a rover that does not steer by its wheels' speeds (Rover/AP_MotorsUGV.cpp: pre_arm_check)."""
_NO_FIX = re.compile(r"GPS \d: (Bad|No|no) (fix|GPS)|need 3D fix", re.IGNORECASE)
_WANTS_POSITION = re.compile(r"requires? position", re.IGNORECASE)
_RECEIVER = re.compile(r"GPS\d?_TYPE\d?")
_STICKS = ("RCMAP_ROLL", "RCMAP_PITCH", "RCMAP_THROTTLE", "RCMAP_YAW")
_OFF, _ANSWERS, _BY_GPS = 0, 1, 3
"""GPS_TYPE of a receiver that is switched off; GPS.Status of one without a fix, below it none is there; and
EK3_SRC1_POSXY of what knows its place by a receiver."""
_SAME = 1e-6
"""Vehicles hold parameters in 32 bits."""

_SENSING, _LEVEL = re.compile(r"_(MONITOR|VOLT_PIN)$"), re.compile(r"_(LOW|CRT|ARM|MIN)_(VOLT|MAH)2?$|_VOLT2?_MIN$")


class Refusing(NamedTuple):
    """A parameter that keeps the vehicle from arming."""

    name: str
    words: str
    """Its value, its default, what the check asks, and the way back."""
    wanted: float | None
    probability: float
    is_shown: bool
    """Whether its value alone keeps the check from passing, or the text names it."""
    is_beside: bool = False
    """Whether it has to be right as well, of a reason that another one stands for."""


class _Held(NamedTuple):
    """A parameter when arming was refused."""

    name: str
    value: float
    default: float | None
    role: Role | None

    @property
    def is_off(self) -> bool:
        return self.default is not None and not math.isclose(self.value, self.default, rel_tol=_SAME, abs_tol=1e-9)

    @property
    def is_far_off(self) -> bool:
        """Whether it is off so far that a check may fail by it; what a vehicle is calibrated to is off rightly."""
        if self.default is None or not self.is_off or self.role not in ("choice", "wiring", "safety"):
            return False
        is_code = abs(self.default) <= _CODES and self.default.is_integer() and self.value.is_integer()
        if self.role == "wiring" or is_code or self.default == 0:
            return True
        ratio = self.value / self.default
        return not 1 / _FAR <= ratio <= _FAR


def standing(flight: Flight) -> tuple[Refusal, ...]:
    """The refusals that stood when arming was last refused. What several attempts to arm no longer told had passed: the
    estimator that was still starting, a gyro that was not yet quiet."""
    lasting = flight.lasting_refusals
    late = [one for one in lasting if lasting[-1].time_s - one.time_s < _REPEATED_S]
    told = {one.why: one.time_s for one in late}
    times = sorted(one.time_s for one in late)
    rounds = [t for before, t in pairwise((-math.inf, *times)) if t - before > _ONE_ROUND_S]
    passed = {why for why, last in told.items() if sum(t > last + _ONE_ROUND_S for t in rounds) >= _PASSED}
    return tuple(one for one in late if one.why not in passed)


def refusing(flight: Flight) -> tuple[Refusing, ...]:
    """The parameters behind the refusals that stood: those that cannot hold, else those that are off."""
    last = standing(flight)
    complaints = dict.fromkeys(one.why for one in last)
    if any(map(_NO_FIX.search, complaints)):  # whatever wants a position is met by the fix
        complaints = {why: None for why in complaints if not _WANTS_POSITION.search(why)}
    found = [one for why in complaints for one in _behind(flight, why, last[-1].time_s)]
    others = (each for why in complaints for each in _other_motors(flight, why))
    found += [one._replace(is_beside=True) for why in others for one in _behind(flight, why, last[-1].time_s)]
    shown = [one for one in found if one.is_shown]
    told = tuple({one.name: one for one in shown or found}.values())
    if len(told) <= MOST or shown:
        return told
    # Of many that are off each is as likely right: a vehicle that is wired so has them so.
    return tuple(one._replace(wanted=None, words=one.words.partition(":")[0]) for one in told)


def _other_motors(flight: Flight, why: str) -> Iterator[str]:
    """What the same refusal would say of the motors behind the one that it names which no output drives either: its
    check stops at the first."""
    named = _MOTOR.search(why)
    if named is None:
        return
    frame = flight.setting("Q_FRAME_CLASS") if flight.setting("Q_ENABLE") else flight.setting("FRAME_CLASS")
    driven = {flight.setting(f"SERVO{n}_FUNCTION") for n in OUTPUTS}
    for number in range(int(named[1]) + 1, MOTORS_OF_FRAME.get(int(frame or 0), 0) + 1):
        if MOTORS[number] not in driven:
            yield f"{why[: named.start(1)]}{number}{why[named.end(1) :]}"


def _behind(flight: Flight, why: str, at_s: float) -> Iterator[Refusing]:
    reads = refusal_reads(why, flight.mode_kind, flight.settings)
    values = dict(_values(flight.settings, at_s))
    is_outside = "world" in reads.also
    read = [name for name in reads.parameters if name in values and name not in flight.shown_right]
    held = _of_lacking_outputs(flight, why, [_setting_of(flight, name, values[name]) for name in read])
    if "voltage" in reads.also:
        yield from (_refusing(one, OFF, is_shown=True) for one in _of_voltage(flight, held, why))
        return
    broken = [one for one in reads.must if one.is_broken(values)]
    bound = {
        name: _setting_of(flight, name, values[name]) for must in broken for name in must.parameters if name in values
    }
    named = [one for one in held if one.name in reads.named]
    if proven := _enough(_at_fault(list(bound.values())), broken, values) or list(bound.values()):
        sure = PLAUSIBLE if is_outside else PROVEN
        for one in proven:
            only = next((value for must in broken if (value := must.value_of(one.name)) is not None), None)
            yield _refusing(one, sure, _asks(one, broken, values), is_shown=True, only=only)
    elif proven := _at_fault(named):
        yield from (_refusing(one, PROVEN, is_shown=True) for one in proven)
    elif (unanswered := [one for one in held if one.is_off and _RECEIVER.fullmatch(one.name)]) and _is_without(flight):
        is_by_gps = flight.setting("EK3_SRC1_POSXY") in (None, _BY_GPS)
        yield from (_unanswered(one, is_wanted=is_by_gps) for one in unanswered)
    else:
        sure = OFF * OUTSIDE if is_outside else OFF
        yield from (_unproven(flight, _refusing(one, sure), one) for one in held if one.is_far_off)


def _of_lacking_outputs(flight: Flight, why: str, held: list[_Held]) -> list[_Held]:
    """Of a rover that lacks steering or throttle the outputs that have it as shipped: the others are what they are."""
    if not _STEERS.search(why):
        return held
    driven = {flight.setting(f"SERVO{n}_FUNCTION") for n in OUTPUTS}
    lacking = [one for one in held if one.default in _STEERING_AND_THROTTLE and one.default not in driven]
    return lacking or held


def _unproven(flight: Flight, refusing: Refusing, one: _Held) -> Refusing:
    """What a check reads, and nothing shows to be wrong: how a real vehicle is wired and mounted is off the default
    rightly, and its operator looks at it before it is put back."""
    if flight.is_simulated or one.role not in OF_THIS_VEHICLE or _is_beyond_sticks(flight, one):
        return refusing
    return refusing._replace(wanted=None, words=f"{refusing.words.partition(':')[0]}: {way_back(one.name, None, None)}")


def _is_beyond_sticks(flight: Flight, one: _Held) -> bool:
    """Whether a stick is looked for behind the four channels that every transmitter has its sticks on, and its own is
    free."""
    others = {name: flight.setting(name) for name in _STICKS if name != one.name}
    return one.name in _STICKS and one.value > len(_STICKS) and one.default not in others.values()


def _is_without(flight: Flight) -> bool:
    """Whether no receiver ever told of a satellite."""
    return not any((table["Status"] >= _ANSWERS).any() for table in flight.all("GPS", "Status"))


def _unanswered(one: _Held, *, is_wanted: bool) -> Refusing:
    """A kind of receiver that was set and that never answered: it, or the receiver; which its operator knows. One that
    is switched off answers nobody, and is put back on where the vehicle is to know its place by it."""
    if one.value == _OFF and one.default and is_wanted:
        return _refusing(one, PLAUSIBLE, "which is none", is_shown=True)
    words = f"{one.name} is {one.value:g} (default {one.default:g}), and no receiver answers: check it and its cable"
    return Refusing(one.name, words, None, PLAUSIBLE, is_shown=True)


def _at_fault(held: Sequence[_Held]) -> list[_Held]:
    """Those that are off their default; all where no default is known."""
    off = [one for one in held if one.is_off]
    return off or [one for one in held if one.default is None]


def _enough(held: list[_Held], broken: Sequence[Must], values: Mapping[str, float]) -> list[_Held]:
    """Those of which each alone, at its default, has the check pass; all where none has."""
    enough = [
        one
        for one in held
        if one.default is not None
        and not any(must.is_broken({**values, one.name: one.default}) for must in broken if one.name in must.parameters)
    ]
    return enough or held


def _asks(one: _Held, broken: Sequence[Must], values: Mapping[str, float]) -> str:
    return next(must.asks(one.name, values) for must in broken if one.name in must.parameters)


def _of_voltage(flight: Flight, held: Sequence[_Held], why: str) -> list[_Held]:
    """What makes a battery that is full read as too low: a wrong scale or pin, or a level above what a full pack has. A
    battery that is not full is the reason itself."""
    scale = wrong_scale(flight)
    if scale is not None:
        return [one for one in held if one.name in scale.parameters]
    number = int(next(iter(re.findall(r"\d+", why)), "1"))
    battery = next((one for one in flight.batteries if one.number == number), None)
    cell = 0.0 if battery is None or battery.rest_v is None else battery.rest_v / battery.cells
    off = [one for one in held if one.is_off]
    if cell < _NONE_AT:  # a monitor that is switched off as shipped is no better for being so again
        return [
            one for one in off if _SENSING.search(one.name) and not (one.name.endswith("_MONITOR") and not one.default)
        ]
    return [one for one in off if _LEVEL.search(one.name)] if cell >= _FULL_AT else []


def _values(settings: Mapping[str, tuple[Setting, ...]], at_s: float) -> Iterator[tuple[str, float]]:
    """The numbers in force at a time."""
    for name, history in settings.items():
        value = [one for one in history if one is history[0] or (one.changed_at_s or 0.0) <= at_s][-1].value
        if isinstance(value, (int, float)) and math.isfinite(value):
            yield name, float(value)


def _setting_of(flight: Flight, name: str, value: float) -> _Held:
    recorded = flight.settings[name][-1].default
    known = float(recorded) if isinstance(recorded, (int, float)) else firmware_default(name, flight.mode_kind)
    meaning = meaning_of(name, flight.mode_kind)
    return _Held(name, value, known, None if meaning is None else meaning.role)


def _refusing(
    one: _Held, probability: float, asks: str = "", *, is_shown: bool = False, only: float | None = None
) -> Refusing:
    """`only`: the one value that its check takes."""
    default = "" if one.default is None else f" (default {one.default:g})"
    told = f"{one.name} is {one.value:g}{default}{f', {asks}' if asks else ''}"
    asked = only if only is not None else one.default if one.is_off else None
    wanted = asked if one.role in SET_BY_HAND else None
    back = way_back(one.name, one.role, wanted, "puts it back" if only is None else "sets it")
    return Refusing(one.name, f"{told}: {back}", wanted, probability, is_shown)

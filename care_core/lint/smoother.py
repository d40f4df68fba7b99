"""The velocity smoother: lists that it refuses, and limits that do not fit those of the controller."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from care_core.lint.problems import Entry, LintedFile, Problem
from care_core.lint.readers import CONTROLLERS, TOP_SPEEDS, Readers, numbers
from care_core.lint.scopes import class_of

_SMOOTHER = "velocity_smoother.cpp of every release, on_configure"
_SINCE_IRON = "velocity_smoother.cpp, on_configure, since iron; in humble the command is kept between the two"
_REFUSED = "the node will not start"
_FORCED = "the node will not start, and that of humble drives the robot on when it is to stop"
_VECTORS: Mapping[str, tuple[int, str, str]] = {
    "max_velocity": (1, _FORCED, _SINCE_IRON), "min_velocity": (-1, _FORCED, _SINCE_IRON),
    "max_accel": (1, _REFUSED, _SMOOTHER), "max_decel": (-1, _REFUSED, _SMOOTHER),
    "deadband_velocity": (0, "", ""),
}  # fmt: skip
"""Lists of the velocity smoother: the sign of their numbers, what happens with another, and what says so."""
_CLAMPED = "velocity_smoother.cpp keeps every command between the two, smootherTimer"
_FORWARDS: Mapping[str, Sequence[str]] = dict.fromkeys(CONTROLLERS, TOP_SPEEDS)
_TURNS: Mapping[str, Sequence[str]] = {
    "DWBLocalPlanner": ("max_vel_theta",), "MPPIController": ("wz_max",), "GracefulController": ("v_angular_max",),
}  # fmt: skip
"""By controller, the largest speed that it plans with."""
_LENGTHS = (3, 6)
"""Of its lists: the last number is of the turn."""
_SAME = 0.9
"""A limit of at least this share of the planned speed costs little."""
_AXES = "Give it 3, for x, y and the turn; since lyrical all five lists may have 6."


def _smoothed(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """A smoother that lets nothing through."""
    top = held.one(CONTROLLERS, TOP_SPEEDS)
    for reader in held.of("velocity_smoother"):
        for name in ("max_velocity", "max_accel"):
            entry = reader.values.get(name)
            own = numbers(entry)
            if entry is None or len(own) not in _LENGTHS:
                continue
            for number, where, does in ((own[0], "begins", "moves"), (own[-1], "ends", "turns")):
                if number == 0:
                    text = f"{name} of velocity_smoother {where} with 0: the robot never {does}."
                    yield file.warning("cannot-work", entry, text, "It must be above 0.", "velocity_smoother.cpp")
        entry = reader.values.get("deadband_velocity")
        first = numbers(entry)[:1]
        if entry is not None and top is not None and top.number and first and first[0] >= top.number > 0:
            text = f"deadband_velocity ({first[0]:g}) swallows every speed up to {top.keys[-1]} ({top.number:g})."
            yield file.warning("contradiction", entry, text, "Lower it.", "velocity_smoother.cpp", [top])


def _vectors(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Lists of the velocity smoother that it refuses: of another length, or with the wrong sign."""
    for reader in held.of("velocity_smoother"):
        lists = {name: one for name in _VECTORS if (one := reader.values.get(name)) is not None and numbers(one)}
        sizes = {name: len(numbers(one)) for name, one in lists.items()}
        wanted = 6 if len(sizes) == len(_VECTORS) and set(sizes.values()) == {6} else 3
        for name, entry in lists.items():
            own = numbers(entry)
            if len(own) != wanted:
                text = f"{name} has {_count(len(own), 'number')}: the node will not start."
                yield file.error("cannot-work", entry, text, _AXES, _SMOOTHER)
            sign, why, source = _VECTORS[name]
            wrong = next((one for one in own if one * sign < 0), None)
            if sign and wrong is not None:
                side = "above" if sign > 0 else "below"
                text = f"{name} holds {wrong:g}: {why}."
                hint = f"Each of its numbers must be 0 or {side} it."
                yield file.error("cannot-work", entry, text, hint, source)


def _count(count: int, what: str) -> str:
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def _slower(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """A smoother that lets through less than the controller plans with."""
    for reader in held.of("velocity_smoother"):
        entry = reader.values.get("max_velocity")
        limits = numbers(entry)
        if entry is None or len(limits) not in _LENGTHS:
            continue
        for limit, names, unit, does in (
            (limits[0], _FORWARDS, "m/s", "drives"),
            (limits[-1], _TURNS, "rad/s", "turns"),
        ):
            top = _only_value(held, names)
            if top is not None and 0 < limit < (top.number or 0.0) * _SAME:
                text = (
                    f"max_velocity of velocity_smoother lets {limit:g} {unit} through, and {top.keys[-1]} is "
                    f"{top.number:g}: the robot {does} slower than the controller plans."
                )
                yield file.warning("hinders", entry, text, "Give both the same.", _CLAMPED, [top])


def _only_value(held: Readers, names: Mapping[str, Sequence[str]]) -> Entry | None:
    """The only value of a controller's limit; None where there is none, or several differ."""
    found = [one for owner, several in names.items() for reader in held.of(owner) if (one := reader.first(several))]
    return found[0] if found and len({one.number for one in found}) == 1 else None


def _backwards(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """A smoother that lets nothing through backwards, though the controller may drive so."""
    for reader in held.of("velocity_smoother"):
        entry = reader.values.get("min_velocity")
        back = next(_reversing(held), None)
        if entry is None or back is None or numbers(entry)[:1] != [0.0]:
            continue
        text = f"min_velocity of velocity_smoother begins with 0, and {back.keys[-1]} is {_shown(back)}: "
        text += "the robot never backs up."
        hint = "Give it a negative number."
        if any(class_of(str(one.value)) == "BackUp" for other in held for one in other.own("plugin")):
            hint += " What the backup behavior sends passes here as well, since jazzy."
        yield file.warning("hinders", entry, text, hint, _CLAMPED, [back])


def _reversing(held: Readers) -> Iterator[Entry]:
    """What allows a controller to drive backwards."""
    for reader in held.of(*CONTROLLERS):
        entry = reader.first(("min_vel_x", "vx_min"))
        if entry is not None and entry.number is not None and entry.number < 0:
            yield entry
        if reader.is_on("allow_reversing"):
            yield reader.values["allow_reversing"]


def _shown(entry: Entry) -> str:
    return str(entry.value) if entry.number is None else f"{entry.number:g}"


RULES = (_smoothed, _vectors, _slower, _backwards)

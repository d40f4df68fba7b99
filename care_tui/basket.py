"""The changes that the operator has ticked, with undo. Values only: nothing is computed and nothing is written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from care_core.variables import Variable

NUDGES = 20
"""Steps from one end of an option's acceptable range to the other."""

Values = Mapping[str, float]


@dataclass
class Basket:
    """What to change to which value. `ticked` are the changes that count; `values` also remembers unticked ones."""

    ticked: dict[str, float] = field(default_factory=dict)
    values: dict[str, float] = field(default_factory=dict)
    _before: list[tuple[dict[str, float], dict[str, float]]] = field(default_factory=list)

    def load(self, changes: Values) -> None:
        """Tick exactly these changes."""
        self._remember()
        self.ticked = dict(changes)
        self.values.update(changes)

    def set(self, option: str, value: float, *, current: float) -> None:
        """Tick one change; the value the run had unticks it."""
        self._remember()
        self.ticked.pop(option, None)
        if value == current:
            self.values.pop(option, None)
        else:
            self.ticked[option] = self.values[option] = value

    def toggle(self, option: str) -> bool:
        """Tick or untick an option whose value is known; False when it has none yet."""
        if option not in self.values:
            return False
        self._remember()
        if self.ticked.pop(option, None) is None:
            self.ticked[option] = self.values[option]
        return True

    def drop(self, option: str) -> None:
        """Untick an option."""
        if option in self.ticked:
            self.toggle(option)

    def undo(self) -> bool:
        """Take the last change back; False when there is none."""
        if not self._before:
            return False
        self.ticked, self.values = self._before.pop()
        return True

    def _remember(self) -> None:
        self._before.append((dict(self.ticked), dict(self.values)))


def nudged(option: Variable, value: float, by: int) -> float:
    """The value `by` steps up or down, acceptable and of the option's type; the next code of an enum."""
    if option.labels:
        codes = [code for code, _ in option.labels]
        place = codes.index(value) if value in codes else 0
        return codes[min(max(place + by, 0), len(codes) - 1)]
    if option.type == "bool":
        return float(by > 0)
    low, high = option.range or (value - abs(value or 1.0), value + abs(value or 1.0))
    if option.is_log_scaled and value > 0:
        moved = value * (high / low) ** (by / NUDGES)
    else:
        moved = value + by * (high - low) / NUDGES
    if option.type == "int" and abs(moved - value) < 1:
        moved = value + by
    return option.snap(moved)


def parsed(option: Variable, text: str) -> float:
    """What the operator typed for an option: a number, a label, or true and false.

    Raises:
        ValueError: it is none of these, or not an acceptable value; the message says what is.
    """
    word = text.strip().casefold()
    named = {label.casefold(): code for code, label in option.labels}
    if option.type == "bool":
        named |= {"true": 1.0, "yes": 1.0, "on": 1.0, "false": 0.0, "no": 0.0, "off": 0.0}
    try:
        value = named[word] if word in named else float(word)
    except ValueError:
        raise ValueError(f"'{text}' is no number. {acceptable(option)}") from None
    # snap() also rounds floats, which is no reason to refuse what was typed.
    whole = option.type not in ("int", "bool") or value == round(value)
    if value != value or not option.accepts(value) or not whole:
        raise ValueError(f"{text} is not acceptable. {acceptable(option)}")
    return value


def acceptable(option: Variable) -> str:
    """The acceptable values of an option in words."""
    if option.labels:
        return "Possible are " + ", ".join(f"{code:g} ({label})" for code, label in option.labels) + "."
    if option.type == "bool":
        return "Possible are true and false."
    kind = "whole numbers" if option.type == "int" else "numbers"
    if option.range is None:
        return f"Possible are {kind}."
    unit = f" {option.unit}" if option.unit else ""
    return f"Possible are {kind} from {option.range[0]:g} to {option.range[1]:g}{unit}."

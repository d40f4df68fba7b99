"""The changes that the operator has ticked, with undo. Values only: nothing is computed and nothing is written."""

from __future__ import annotations

from collections.abc import Mapping

from care_core.configs.driven import option_value
from care_core.records import Struct, field
from care_core.report.axes import round_step
from care_core.run import Setting
from care_core.variables import Variable

NUDGES = 20
"""Steps from one end of an option's acceptable range to the other."""

Values = Mapping[str, float]


class Basket(Struct, eq=False):
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
        if value == current:
            self.ticked.pop(option, None)
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
        moved = _rounded(value * (high / low) ** (by / NUDGES), value)
    else:
        moved = value + by * round_step((high - low) / NUDGES)
    if option.type == "int" and abs(moved - value) < 1:
        moved = value + by
    return option.snap(moved)


def _rounded(moved: float, value: float) -> float:
    """The value in as few digits as tell it from the one before."""
    return next((short for digits in (2, 3) if (short := float(f"{moved:.{digits}g}")) != value), moved)


def parsed(option: Variable, text: str) -> float:
    """What the operator typed for an option: a number, a label, or true and false.

    Raises:
        ValueError: it is none of these, or the option may not have this value; the message says what it may be.
    """
    value = option_value(option, Setting(option.name, text, "typed"))
    if value is None:
        raise ValueError(f"'{text}' is not a number. {possible(option)}")
    is_whole = option.type not in ("int", "bool") or value == round(value)
    if not (option.accepts(value) and is_whole):
        raise ValueError(f"'{text}' cannot be taken. {possible(option)}")
    return value


def possible(option: Variable) -> str:
    """What may be typed for an option, in a sentence."""
    if option.labels:
        return f"Allowed: {option.acceptable}."
    if option.type == "bool":
        return "Allowed: true and false."
    kind = "whole numbers" if option.type == "int" else "numbers"
    return f"Allowed: {kind}." if option.range is None else f"Allowed: {kind} from {option.acceptable}."

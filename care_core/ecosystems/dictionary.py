"""What the messages of an ecosystem mean: the one table that checks, measures and plots read."""

from __future__ import annotations

from collections.abc import Mapping

from care_core.records import Record


class Field(Record):
    """A number or text of a message, under today's name."""

    unit: str = ""
    label: str = ""
    """In words, as a plot has it: "battery voltage"."""
    former: tuple[str, ...] = ()
    """What older firmware calls it, the youngest name first."""
    plausible: tuple[float, float] | None = None
    """Least and greatest value, in `unit`, that a working sensor can give."""
    is_position: bool = False
    """Whether it says where on earth, or on the map of its site, the robot was: nothing to share unasked."""


class Message(Record):
    """A message or topic, under today's name."""

    fields: Mapping[str, Field]
    former: tuple[str, ...] = ()
    """What older firmware calls it, the youngest name first."""
    instance: str = ""
    """The field that tells sensors of one kind apart; empty where each has a message of its own."""


Dictionary = Mapping[str, Message]


def find_field(dictionary: Dictionary, message: str, name: str) -> Field | None:
    """What a field means, by today's names or former ones; None where that is not known."""
    known = dictionary.get(message) or next((one for one in dictionary.values() if message in one.former), None)
    if known is None:
        return None
    return known.fields.get(name) or next((one for one in known.fields.values() if name in one.former), None)

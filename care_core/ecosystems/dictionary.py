"""What the messages of an ecosystem mean: the one table that checks, measures and plots read."""

from __future__ import annotations

from collections.abc import Collection, Mapping

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
    step: float | None = None
    """Further than this no vehicle gets from one sample to the next and, by the one after, back to within half."""
    is_position: bool = False
    """Whether it says where on earth, or on the map of its site, the robot was: nothing to share unasked."""


class Message(Record):
    """A message or topic, under today's name."""

    fields: Mapping[str, Field]
    former: tuple[str, ...] = ()
    """What older firmware calls it, the youngest name first."""
    instance: str = ""
    """The field that tells sensors of one kind apart; empty where each has a message of its own."""
    moving: tuple[str, ...] = ()
    """Fields of which at least one changes in any run, by the estimator's noise alone."""
    fastest_hz: float | None = None
    """Most messages of a sensor in a second."""
    slowest_s: float | None = None
    """Longest usual time between two messages of a sensor, also in thinned logs."""
    in_bursts: bool = False
    """Whether a vehicle writes them as fast as they come: parameters, mission items."""
    at_times: bool = False
    """Whether it is written only while there is something to say, so that its silence is no hole: commands,
    controllers that steer, texts."""
    log_bits: int = 0
    """Bits of the parameter that has a vehicle write it; 0 where it always does, or nothing is known of it."""
    how_to_record: str = ""
    """What to do to have it in the next log: "set 'GPS' (4) in LOG_BITMASK"."""


Dictionary = Mapping[str, Message]


def find_message(dictionary: Dictionary, name: str) -> Message | None:
    """What a message means, by today's name or a former one; None where that is not known."""
    return dictionary.get(name) or next((one for one in dictionary.values() if name in one.former), None)


def find_field(dictionary: Dictionary, message: str, name: str) -> Field | None:
    """What a field means, by today's names or former ones; None where that is not known."""
    known = find_message(dictionary, message)
    if known is None:
        return None
    return known.fields.get(name) or next((one for one in known.fields.values() if name in one.former), None)


def instance_field(known: Message, columns: Collection[str]) -> str | None:
    """Which of these columns numbers the sensors of a message, by today's or a former name; None where none does."""
    instance = known.fields.get(known.instance)
    names = (known.instance, *(instance.former if instance is not None else ()))
    return next((name for name in names if name in columns), None)

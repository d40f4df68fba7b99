"""Which fields a ROS message has: from the definition in the log, else from the message sets of the distributions."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import lru_cache

from care_core import limits
from care_core.logs.base_types import DEFINITIONS
from care_core.logs.cdr_message import wide_size
from care_core.logs.ros_message import MalformedMessageError, MessageField, Types, parse_definition, short_name

_DISTROS = ("humble", "foxy", "galactic")
"""Tried in this order where a log names neither its definitions nor its distribution: later ones always do."""

_LANGUAGES = ("", "ros2msg", "ros2idl", "omgidl")
_IDL_SEPARATOR = re.compile(r"^=+\s*\nIDL: (\S+)\s*$", re.MULTILINE)
_DIRECTIVE = re.compile(r"^\s*#.*$", re.MULTILINE)
_PADDING_FIELD = MessageField("structure_needs_at_least_one_member", "uint8", None)
"""What ROS 2 puts into a message that has no field."""


def cdr_types(type_name: str, definition: str, language: str, distro: str, sample: bytes) -> tuple[Types, int]:
    """The fields of a ROS 2 type, and the bytes a character of its wstrings takes.

    Args:
        definition: as the log holds it; empty where it holds none.
        language: `ros2msg` or `ros2idl`.
        distro: the log's ROS distribution, empty where unknown.
        sample: a message of the type; with a choice, the first definition that takes exactly its bytes is right.

    Raises:
        MalformedMessageError: the definition is not understood, or nobody knows the type.
    """
    if definition.strip() and language in _LANGUAGES:
        known = _from_idl(type_name, definition) if "idl" in language else parse_definition(type_name, definition)
        known = _filled(known)
        return known, wide_size(type_name, known, sample) or 4
    found = None
    for candidate in _bundled(type_name, distro):
        wide = wide_size(type_name, candidate, sample)
        if wide is not None:
            return candidate, wide
        found = found or candidate
    if found is None:
        raise MalformedMessageError(f"the log holds no definition of {type_name}, and it is no standard message")
    return found, 4


def _filled(types: Types) -> Types:
    """With the byte that ROS 2 puts into a message without fields."""
    return {name: fields or [_PADDING_FIELD] for name, fields in types.items()}


def _from_idl(type_name: str, definition: str) -> Types:
    from rosbags.typesys import Stores, get_types_from_idl, get_typestore

    if len(definition) > limits.DEFINITION_BYTES:
        raise MalformedMessageError(f"its definition is larger than {limits.megabytes(limits.DEFINITION_BYTES)}")
    _, *rest = _IDL_SEPARATOR.split(definition)
    try:
        store = get_typestore(Stores.EMPTY)
        for text in reversed(rest[1::2] or [definition]):  # what a type is made of comes after it
            found = get_types_from_idl(_DIRECTIVE.sub("", text))
            store.register({name: fields for name, fields in found.items() if name not in store.fielddefs})
        text, _ = store.generate_msgdef(_long_name(type_name), ros_version=2)
    except Exception as err:  # the grammar raises whatever it met
        raise MalformedMessageError(f"definition of {type_name} not understood") from err
    return parse_definition(type_name, text)


def _bundled(type_name: str, distro: str) -> Iterator[Types]:
    """The type as the log's own distribution defines it; where that is unknown, as each that may be meant does."""
    from rosbags.typesys import Stores

    known = {store.value.removeprefix("ros2_") for store in Stores if store.value.startswith("ros2_")}
    for name in (distro,) if distro in known else _DISTROS:
        text = _bundled_text(name, _long_name(type_name))
        if text is not None:
            yield _filled(parse_definition(type_name, text))
    if _long_name(type_name) in DEFINITIONS:
        yield parse_definition(type_name, DEFINITIONS[_long_name(type_name)])


@lru_cache(maxsize=256)
def _bundled_text(distro: str, type_name: str) -> str | None:
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores(f"ros2_{distro}"))
    if type_name not in store.fielddefs:
        return None
    text, _ = store.generate_msgdef(type_name, ros_version=2)
    return text


def _long_name(type_name: str) -> str:
    return type_name if type_name.count("/") > 1 else short_name(type_name).replace("/", "/msg/")

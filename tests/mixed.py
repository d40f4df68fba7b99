"""Recordings of our own in one file: topics renamed into a name space, left out, or cut off."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from mcap.reader import make_reader
from mcap.records import Schema
from mcap.writer import Writer

Rename = Callable[[str, float], "str | None"]
"""The name of a topic at a second of its recording, None where the message is left out."""


def mix(path: Path, *parts: tuple[Path, Rename]) -> Path:
    """The messages of several MCAP files in one, each from its own first second on."""
    messages: list[tuple[int, str, bytes]] = []
    kinds: dict[str, tuple[Schema, str]] = {}
    for source, rename in parts:
        with source.open("rb") as stream:
            every = list(make_reader(stream).iter_messages())
        first_ns = every[0][2].log_time
        for schema, channel, message in every:
            topic = rename(channel.topic, (message.log_time - first_ns) / 1e9)
            if topic is not None and schema is not None:
                kinds[topic] = schema, channel.message_encoding
                messages.append((message.log_time - first_ns + 10**18, topic, message.data))
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2", library="test")
        ids = {}
        for topic, (schema, encoding) in kinds.items():
            number = writer.register_schema(schema.name, schema.encoding, schema.data)
            ids[topic] = writer.register_channel(topic, encoding, number)
        for number, (time_ns, topic, data) in enumerate(sorted(messages, key=lambda one: one[0])):
            writer.add_message(ids[topic], time_ns, data, time_ns, number)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def in_namespace(space: str) -> Rename:
    return lambda topic, _: f"{space}{topic}"


def until(end_s: float, *parts: str) -> Rename:
    """Topics with one of these parts in their name end at a time."""
    return lambda topic, t: None if t > end_s and any(part in topic for part in parts) else topic

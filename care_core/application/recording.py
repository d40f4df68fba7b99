"""What to record so that a profile finds what it reads: the recorder's command, or the log settings of a vehicle."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from care_core.configs.formats import format_for, write_params
from care_core.ecosystems.base import Recording
from care_core.ecosystems.registry import ecosystem_of, ecosystems
from care_core.errors import UsageError, nearest
from care_core.files import profile_folders
from care_core.logs.formats import format_named
from care_core.profile.schema import Schema
from care_core.records import Record
from care_core.run import Setting
from care_core.text import command

Stack = Literal["ros1", "ros2", "vehicle"]
_OF_ROS2 = ("/fault_manager/events", "/parameter_events")
"""Changes of parameters, and faults as ros2_medkit tells them."""
_RECONFIGURE = "/.*/parameter_(descriptions|updates)"
"""What the nodes of ROS 1 tell of their parameters, with ranges and defaults."""


class ToRecord(Record):
    """What to record for a profile, or for any robot of an ecosystem."""

    name: str
    stack: Stack
    recording: Recording
    log_format: str
    """Of the logs that come of it."""

    @property
    def topics(self) -> tuple[str, ...]:
        """What a ROS recorder is to listen to."""
        return (*self.recording.channels, *(_OF_ROS2 if self.stack == "ros2" else ()))

    @property
    def parameter_file(self) -> str:
        """The log settings of a vehicle as its ground stations load them."""
        settings = {name: Setting(name, value, self.name) for name, value in self.recording.settings.items()}
        return write_params(settings, format_for(self.log_format), self.recording.remarks)


def what_to_record(name: str, more: Sequence[str] = ()) -> ToRecord:
    """What to record for a profile of this name, or for any robot of an ecosystem.

    Args:
        more: topics beside those.

    Raises:
        UsageError: there is no such profile or ecosystem, or it comes from a table and reads no log.
        ProfileError: the profile is unsound.
    """
    from care_core.extract.read import reading_plan
    from care_core.profile.store import load_profile

    known = {one.name: one for one in ecosystems()}
    if name in known:
        formats, channels, vehicle = known[name].formats, set(more), ""
        return _to_record(name, formats[-1].name if name == "ros" else formats[0].name, channels, vehicle)
    if name not in profile_folders():
        names = [*profile_folders(), *known]
        hint = nearest(name, names) or f"There are {', '.join(names)}."
        raise UsageError(f"There is no profile '{name}'.", hint=hint)
    schema = load_profile(name).schema
    if not schema.logs:
        raise UsageError(f"The profile '{name}' comes from a table of runs and reads no log.")
    return _to_record(name, schema.logs[0], {*reading_plan(schema), *more}, _vehicle(schema))


def _to_record(name: str, log_format: str, channels: set[str], vehicle: str) -> ToRecord:
    ecosystem = ecosystem_of(format_named(log_format))
    recording = ecosystem.to_record(channels, vehicle)
    stack: Stack = "vehicle" if recording.settings else "ros1" if log_format == "ros1-bag" else "ros2"
    return ToRecord(name, stack, recording, log_format)


def _vehicle(schema: Schema) -> str:
    return schema.match.get("vehicle", "")


def recorder_words(found: ToRecord, out: Path, *, is_humble: bool = False) -> list[str]:
    """The command of the recorder of ROS.

    Args:
        is_humble: the recorder takes topics without `--topics` alone, as up to Humble.
    """
    if found.stack == "ros1":
        topics = "|".join(re.escape(topic) for topic in found.topics)
        return ["rosbag", "record", "--lz4", "-O", str(out), "-e", f"^({topics}|{_RECONFIGURE})$"]
    hidden = ["--include-hidden-topics"] if any("/_" in topic for topic in found.topics) else []
    listed = [] if is_humble else ["--topics"]
    return ["ros2", "bag", "record", "-o", str(out), *hidden, *listed, *found.topics]


def recording_text(found: ToRecord, out: Path) -> str:
    """What to do before the next run, in lines for a shell or a ground station."""
    if found.stack == "vehicle":
        return found.parameter_file
    line = command(*recorder_words(found, out))
    if found.stack == "ros1":
        return f"{line}\n"
    lines = (
        f"# What {found.name} reads; started before the nodes, it hears their parameters, too.",
        line,
        "# Meanwhile, in another terminal, the parameters of nodes that ran before; care looks for them there:",
        f"for node in $(ros2 node list); do ros2 param dump $node; done > {command(str(out / 'care_parameters.yaml'))}",
        f"# Both at once: {command('care', 'record', found.name, '--run', '-o', str(out))}",
    )
    return "\n".join(lines) + "\n"

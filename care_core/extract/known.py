"""What is known of a robot's parameters before a profile is chosen by them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from care_core.configs.loading import ConfigFile, resolve
from care_core.ecosystems.ros.dialect import ROS2_YAML
from care_core.logs.base import Log
from care_core.profile.schema import Schema
from care_core.run import Settings


def known_settings(log: Log, files: Sequence[ConfigFile], said: Settings, schemas: Iterable[Schema]) -> Settings:
    """What the log holds, before what its messages said, before what files say of the nodes that the profiles name.

    Only where profiles differ by what the robot is put together from: the others are chosen by the log alone.
    """
    logged = log.settings()
    differing = [schema for schema in schemas if schema.plugins]
    if not differing or not (files or said):
        return logged
    names = {name for schema in differing for name in schema.plugins}
    nodes = {name.partition(".")[0] for schema in differing for name in (*schema.plugins, *_parameters(schema))}
    paths = {name.partition(".")[2] for file in files if _names_nodes(file) for name in file.settings}
    given = resolve(files, {*names, *(f"{node}.{path}" for node in nodes for path in paths)})
    return {**{name: (one,) for name, one in given.items()}, **said, **logged}


def _parameters(schema: Schema) -> Iterable[str]:
    return (name for option in schema.options for name in option.parameters)


def _names_nodes(file: ConfigFile) -> bool:
    return file.format is ROS2_YAML

"""Campaigns for tests: the bundled robot's profile, and a command that copies a drive made before."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ruamel.yaml import YAML

from care_core.collect.space import Axis, Space
from care_core.constraints import parse_constraint
from care_core.variables import Role, Variable
from care_samples.robot.mission import DEFAULTS, Robot
from care_samples.robot.recording import write_bag
from care_samples.robot.starting import write_robot
from care_samples.robot.world import Conditions

COPY = "cp drive.bag {logs}/drive.bag"


def campaign_in(folder: Path, **changes: Any) -> Path:
    """A campaign of four runs in a folder with what it names; keys may be changed or, with None, left out."""
    write_robot(folder, 1)
    (folder / "drive.bag").write_bytes(drive(recorded=False))  # so every run drove what it was asked
    written: dict[str, Any] = {
        "schema_version": 1,
        "profile": "profile.yaml",
        "parameters": "courier.yaml",
        "command": COPY,
        "runs": 4,
        "options": ["max_speed", "controller_frequency"],
        **changes,
    }
    path = folder / "campaign.yaml"
    with path.open("w", encoding="utf-8") as stream:
        YAML().dump({key: value for key, value in written.items() if value is not None}, stream)
    return path


@cache
def drive(*, recorded: bool) -> bytes:
    """A drive with the reference as a bag, with its parameters or without."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "drive.bag"
        write_bag(path, Robot({}, Conditions.of(1)).run(), DEFAULTS if recorded else {})
        return path.read_bytes()


def space(ranges: Mapping[str, tuple[float, float]], *limits: str, kinds: Mapping[str, str] | None = None) -> Space:
    """Options with the middle of their range as reference."""
    axes = []
    for name, (low, high) in ranges.items():
        kind: Any = (kinds or {}).get(name, "float")
        axes.append(Axis(Variable(name, Role.OPTION, kind, range=(low, high), parameters=(f"/{name}",)), low, high))
    reference = {axis.name: axis.at(0.5) for axis in axes}
    return Space(axes, reference, [parse_constraint(text, reference) for text in limits])

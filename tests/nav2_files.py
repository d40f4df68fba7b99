"""Parameter files of Nav2 in a few lines, and what `care lint` finds in them."""

from __future__ import annotations

from pathlib import Path

from care_core.lint.linting import lint
from care_core.lint.problems import Problem

DWB = "dwb_core::DWBLocalPlanner"
MPPI = "nav2_mppi_controller::MPPIController"
RPP = "nav2_regulated_pure_pursuit_controller::RegulatedPurePursuitController"


def findings(tmp_path: Path, text: str, target: str = "") -> tuple[Problem, ...]:
    path = tmp_path / "nav2.yaml"
    path.write_text(text)
    (linted,) = lint([str(path)], target)
    return linted.problems


def told(tmp_path: Path, text: str, target: str = "") -> list[tuple[str, str, str]]:
    return [
        (one.rule, one.severity.value, one.parameter.rpartition("/")[2]) for one in findings(tmp_path, text, target)
    ]


def node(name: str, *lines: str) -> str:
    return "\n".join([f"{name}:", "  ros__parameters:", *(f"    {line}" for line in lines), ""])


def controller(plugin: str, *lines: str) -> str:
    inner = [f"  plugin: {plugin}", *(f"  {line}" for line in lines)]
    return node("controller_server", "controller_plugins: [FollowPath]", "FollowPath:", *inner)

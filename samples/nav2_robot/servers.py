"""Nav2's servers as processes, each with the parameter file, in a ROS domain of their own."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType

_SMOOTHED = {"cmd_vel": "cmd_vel_nav"}
"""The velocity smoother stands between whoever commands and the drive, as in Nav2's own launch files."""

SERVERS: Mapping[str, tuple[str, str, Mapping[str, str]]] = {
    "controller_server": ("nav2_controller", "controller_server", _SMOOTHED),
    "planner_server": ("nav2_planner", "planner_server", {}),
    "behavior_server": ("nav2_behaviors", "behavior_server", _SMOOTHED),
    "bt_navigator": ("nav2_bt_navigator", "bt_navigator", {}),
    "velocity_smoother": ("nav2_velocity_smoother", "velocity_smoother", {**_SMOOTHED, "cmd_vel_smoothed": "cmd_vel"}),
}
"""By node, in the order in which Nav2 brings them up: package, executable, remapped names."""

_PATIENCE_S = 2.0
"""Who sleeps on the simulated clock does not wake any more."""


def installed(prefixes: str, package: str, name: str) -> Path:
    """An executable of a ROS package.

    Raises:
        FileNotFoundError: no prefix of `AMENT_PREFIX_PATH` has it.
    """
    for prefix in filter(None, prefixes.split(os.pathsep)):
        path = Path(prefix) / "lib" / package / name
        if path.is_file():
            return path
    raise FileNotFoundError(f"there is no {package} {name}: is Nav2 installed and its setup file sourced?")


class Servers:
    """Nav2 while it runs; ends with the block, whatever happens in it."""

    def __init__(self, params: Path, logs: Path) -> None:
        self.params, self.logs = params, logs
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> Servers:
        prefixes = os.environ.get("AMENT_PREFIX_PATH", "")
        programs = {node: installed(prefixes, package, name) for node, (package, name, _) in SERVERS.items()}
        for node, (_, _, renamed) in SERVERS.items():
            words = [str(programs[node]), "--ros-args", "--params-file", str(self.params), "-p", "use_sim_time:=true",
                     "-r", f"__node:={node}"]  # fmt: skip
            for name, other in renamed.items():
                words += ["-r", f"{name}:={other}"]
            with (self.logs / f"{node}.txt").open("wb") as out:
                self._running[node] = subprocess.Popen(
                    words, stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.STDOUT, start_new_session=True
                )
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for process in self._running.values():
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        until = time.monotonic() + _PATIENCE_S
        for process in self._running.values():
            try:
                process.wait(max(0.0, until - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def ended(self) -> str:
        """The node of a server that is no longer there, or nothing."""
        return next((node for node, process in self._running.items() if process.poll() is not None), "")

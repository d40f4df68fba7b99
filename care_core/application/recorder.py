"""The recorder of ROS 2 run, with the parameters of all nodes beside what it records."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from care_core.application.recording import ToRecord, recorder_words
from care_core.errors import UsageError
from care_core.files import write_atomically
from care_core.logs.ros_metadata import PARAMETERS_NAME
from care_core.starting import program_path

_ANSWER_S = 20.0
"""A node that does not tell its parameters in this time is left out."""
_FOLDER_S = 15.0
"""Time for the recorder to make its folder."""
_ENDS_S = 60.0
"""Time for the recorder to write its index after it was told to end."""
_AT_ONCE = 4

Say = Callable[[str], None]


def record(found: ToRecord, out: Path, say: Say) -> int:
    """Record until the recorder ends or is interrupted; its exit code, 0 where it was interrupted.

    The parameters of all nodes are asked for when it starts and written beside the recording at once: a power cut
    leaves them. What changes later is in the recording (`/parameter_events`), and nodes that start later are asked
    when it ends.

    Args:
        out: the folder of the recording, which is not there yet.

    Raises:
        UsageError: ROS 2 is not here, the folder is there already, or nothing could be recorded.
    """
    try:
        ros2 = program_path("ros2")
    except FileNotFoundError as err:
        hint = "Source your ROS 2 installation, or leave out --run to have the command printed."
        raise UsageError("There is no 'ros2' here.", hint=hint) from err
    if out.exists():
        raise UsageError("There is something of that name.", hint="Name a new folder with --out.", where=str(out))
    words = recorder_words(found, out, is_humble="--topics" not in _output_of(ros2, "bag", "record", "--help"))
    # Ctrl+C goes to this process alone, which tells the recorder once: told twice it would leave its index unwritten.
    recorder = subprocess.Popen([ros2, *words[1:]], stdin=subprocess.DEVNULL, stdout=sys.stderr, start_new_session=True)
    asked: dict[str, str] = {}
    try:
        _keep_parameters(ros2, asked, out, recorder, say)
        return recorder.wait()
    except KeyboardInterrupt:
        return 0
    finally:
        _end(recorder)
        if out.is_dir():
            _write(out, asked | _parameters(ros2, asked))


def _keep_parameters(ros2: str, asked: dict[str, str], out: Path, recorder: subprocess.Popen[bytes], say: Say) -> None:
    """Write the parameters of all nodes into the recorder's folder as soon as it is there."""
    asked |= _parameters(ros2, asked)
    until_s = time.monotonic() + _FOLDER_S
    while not out.is_dir() and recorder.poll() is None and time.monotonic() < until_s:
        time.sleep(0.05)
    if not out.is_dir():
        raise UsageError("The recorder made no folder.", hint="What it says above tells why.", where=str(out))
    _write(out, asked)
    say(f"recording into {out}; the parameters of {len(asked)} nodes are beside it. Ctrl+C ends it.")


def _parameters(ros2: str, known: dict[str, str]) -> dict[str, str]:
    """What each node that is not known yet says of its parameters, by node."""
    nodes = [line.strip() for line in _output_of(ros2, "node", "list").splitlines() if line.startswith("/")]
    new = [node for node in dict.fromkeys(nodes) if node not in known]
    with ThreadPoolExecutor(_AT_ONCE) as pool:
        texts = pool.map(lambda node: _output_of(ros2, "param", "dump", node), new)
        return {node: text for node, text in zip(new, texts, strict=True) if "ros__parameters" in text}


def _output_of(*words: str) -> str:
    """What a command prints, nothing where it fails or does not end."""
    try:
        done = subprocess.run(
            words, capture_output=True, text=True, timeout=_ANSWER_S, check=False, stdin=subprocess.DEVNULL
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout if done.returncode == 0 else ""


def _write(out: Path, asked: dict[str, str]) -> None:
    if asked:
        write_atomically(out / PARAMETERS_NAME, "".join(f"{text.rstrip()}\n" for text in asked.values()))


def _end(recorder: subprocess.Popen[bytes]) -> None:
    """Have the recorder write its index and end."""
    if recorder.poll() is not None:
        return
    recorder.send_signal(signal.SIGINT)
    try:
        recorder.wait(_ENDS_S)
    except subprocess.TimeoutExpired:
        recorder.kill()
        recorder.wait()

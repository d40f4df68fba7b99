"""How quick is the terminal app? Drives the real program in a pseudo-terminal and counts what it writes.

    python benchmarks/tui.py [--log LOG] [--runs N]

Prints: first usable frame (warm), key to repaint with 600 options and 200 paths loaded, bytes for one cursor move and
for a change of step, frames drawn while idle. All but the first use a diagnosis made here, so that the engine's time is
not in them. Beside it, on the same terminal in the same run, those of the apps in `PEERS` that are installed.
"""

from __future__ import annotations

import argparse
import os
import pty
import select
import shutil
import statistics
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Sequence
from fcntl import ioctl
from pathlib import Path

from care_core.diagnose.records import Cause, Diagnosis, Fault, Fix, ObjectiveResult, Odds, PathNode, Prediction
from care_core.records import Struct, replace
from care_core.run import LogInfo, MissionInfo, Run
from care_core.run import ProfileChoice as Choice
from care_core.variables import Change, Role, Threshold, Variable

OPTIONS, PATHS = 600, 200
QUIET_S = 0.12
"""Nothing written for so long: the repaint is over."""
PEERS = {
    "lazygit": (("setsid", "--ctty", "--wait", "lazygit"), b"Commits", b"\t"),  # it opens /dev/tty
    "harlequin": (("harlequin",), b"Query Editor", b"\t"),
    "posting": (("posting",), b"Collection", b"\t"),
    "btop": (("btop", "--utf-force"), b"mem", b"\x1b[B"),
}
"""Apps of the terminal: the command, what its first frame holds, and a key that moves the cursor or the focus."""
ROOT = Path(__file__).parent.parent
SAMPLE = ROOT / "samples" / "arducopter_failed.BIN"


def made(options: int = OPTIONS, paths: int = PATHS) -> tuple[Diagnosis, tuple[Variable, ...]]:
    """A diagnosis with many options, and a fault with many causes."""
    names = tuple(
        Variable(f"GROUP{i % 40:02}_OPTION_{i}", Role.OPTION, "float", "m/s", f"what option {i} does", (0.0, 10.0), 1.0)
        for i in range(options)
    )
    time_taken = Variable("mission_time", Role.OBJECTIVE, unit="s", kind="non-functional", threshold=Threshold("<=", 9))
    slow = ObjectiveResult(time_taken, 12.0, time_taken.threshold, "fault", percentile=0.99)
    causes = tuple(
        Cause(
            rank=i + 1,
            option=names[i],
            path=(
                PathNode(names[i].name, "m/s", 2.0 + i, 1.0, effect=0.5 - i / 400, support=0.9),
                PathNode(f"metric_{i % 7}", "m", 3.0 + i, 2.0, effect=0.7, support=0.8),
                PathNode("mission_time", "s", 12.0, 8.0),
            ),
            path_ace=0.6,
            total_effect=0.5,
            contribution=0.9 / (i + 1),
            current=2.0 + i,
            suggested=1.0,
            predicted=Prediction(8.0, 7.0, 9.0, 0.9),
            p_fixed=0.9 / (i + 1),
            confidence="medium",
            in_support=i % 3 > 0,
        )
        for i in range(paths)
    )
    fix = Fix((Change(names[0], 2.0, 1.0),), 0.9, {"mission_time": Prediction(8.0, 7.0, 9.0, 0.9)})
    run = Run(
        {option.name: 2.0 for option in names}, {}, {}, {"mission_time": 12.0}, {},
        LogInfo("/logs/many.BIN", "dataflash-bin", None, 60.0, "0" * 64), MissionInfo(1, 1, 0.0, 60.0, True, True),
    )  # fmt: skip
    choice = Choice("many", "1", "made", "made by the benchmark")
    return Diagnosis(choice, run, (slow,), (Fault(slow, causes),), fix), names


def serve_made() -> None:
    """The app on the made diagnosis, in this process: what the benchmark starts as its child."""
    from care_core.application.case import Case, Request
    from care_tui.settings import Settings, prepare_terminal

    prepare_terminal(Settings())
    from care_tui.app import CareApp
    from care_tui.engine import Engine

    diagnosis, options = made()
    fix = diagnosis.fix
    assert fix is not None
    engine = Engine(
        diagnose=lambda _request, _progress: Case(diagnosis, options),
        predict=lambda _case, changes: replace(fix, p_fixed=1 / (1 + len(changes))),
        odds_over=lambda _case, option, _beside: (Odds(v, i / 25, v > 8) for i, v in enumerate(option.across(25))),
        diff=lambda _case, _fix, _side: "-a\n+b\n",
        report=lambda _diagnosis, format: f"report {format}\n" * 100,
        preview=lambda _case, format: f"report {format.name}\n" * 100,
        commands=lambda _diagnosis: [],
        remember=lambda _diagnosis, _request: None,
    )
    CareApp(Request(Path("/logs/many.BIN")), engine=engine, settings=Settings(places=())).run()


class Terminal(Struct, eq=False):
    """A child in a pseudo-terminal of a given size."""

    fd: int
    process: subprocess.Popen[bytes]
    started: float

    @classmethod
    def start(cls, command: Sequence[str], width: int, height: int) -> Terminal:
        ours, theirs = pty.openpty()
        ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", height, width, 0, 0))
        # As installed: compiled, and found at once.
        env = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
        env |= {"TERM": "xterm-256color", "COLORTERM": "truecolor", "CARE_BENCHMARK": "1", "PYTHONPATH": str(ROOT)}
        started = time.perf_counter()
        process = subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=theirs, env=env, start_new_session=True)
        os.close(theirs)
        return cls(ours, process, started)

    def read(self, until: bytes = b"", timeout: float = 20.0) -> tuple[bytes, float]:
        """What comes until `until` was seen and then it is quiet, and when the last of it came."""
        seen, last, deadline = b"", time.perf_counter(), time.perf_counter() + timeout
        while time.perf_counter() < deadline:
            ready, _, _ = select.select([self.fd], [], [], QUIET_S)
            if ready:
                try:
                    part = os.read(self.fd, 65536)
                except OSError:  # the child has closed its end
                    break
                seen, last = seen + part, time.perf_counter()
            elif not until or until in seen:
                break
        return seen, last

    def key(self, key: bytes) -> tuple[int, float]:
        """Bytes written after a key, and seconds from it to the last of them."""
        sent = time.perf_counter()
        os.write(self.fd, key)
        seen, last = self.read(timeout=3.0)
        return len(seen), last - sent if seen else 0.0

    def cpu_s(self) -> float:
        """Processor time that the child has used."""
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def stop(self) -> None:
        os.write(self.fd, b"q")
        self.read(timeout=2.0)
        try:
            self.process.wait(5)
        except subprocess.TimeoutExpired:  # a peer leaves by another key
            self.process.kill()
            self.process.wait(10)
        os.close(self.fd)


def ours(log: Path) -> list[str]:
    """The command of a new process of this app."""
    return [sys.executable, "-c", "from care_tui.start import main; main()", str(log)]


def first_frame(command: Sequence[str], marker: bytes = b"Objectives") -> tuple[float, float]:
    """Seconds from the start of the process to a frame that holds the marker, of ours to a step bar that answers keys,
    and seconds of processor it took."""
    terminal = Terminal.start(command, 80, 24)
    seen = b""
    while marker not in seen:
        seen += os.read(terminal.fd, 65536)
    elapsed, cpu = time.perf_counter() - terminal.started, terminal.cpu_s()
    terminal.stop()
    return elapsed, cpu


def _beside(name: str, frame_s: float, runs: int) -> None:
    """A peer's first frame, as a ratio to ours, what it writes for a key, and what while nothing happens."""
    command, marker, key = PEERS[name]
    frame = statistics.median(first_frame(command, marker)[0] for _ in range(runs))
    terminal = Terminal.start(command, 80, 24)
    terminal.read(until=marker)
    time.sleep(2)
    terminal.read(timeout=2.0)
    written = statistics.median(terminal.key(key)[0] for _ in range(10))
    idle = 0
    for _ in range(3):
        time.sleep(1)
        idle += len(terminal.read(timeout=0.5)[0])
    terminal.stop()
    print(f"{name}, 80 x 24: first frame {frame:.2f} s ({frame / frame_s:.1f} x ours)")
    print(f"  {written:.0f} bytes for a key, {idle} while idle for 3 s")


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--log", type=Path, default=SAMPLE)
    parser.add_argument("--runs", type=int, default=5)
    arguments = parser.parse_args()
    first_frame(ours(arguments.log))
    frames = sorted(first_frame(ours(arguments.log)) for _ in range(arguments.runs))
    middle, cpu = statistics.median(frame[0] for frame in frames), frames[0][1]
    print(f"load of the machine {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    print(
        f"first usable frame, warm: median {middle:.2f} s, best {frames[0][0]:.2f} s (bar 0.5 s);"
        f" {cpu:.2f} s of processor"
    )
    for width, height in ((80, 24), (120, 40)):
        _measure_keys(width, height)
    for name in filter(shutil.which, PEERS):
        _beside(name, middle, arguments.runs)


def _measure_keys(width: int, height: int) -> None:
    terminal = Terminal.start([sys.executable, "-m", "benchmarks.tui"], width, height)
    terminal.read(until=b"FAULT")
    moves, switches = [], []
    terminal.key(b"3")
    before = terminal.cpu_s()
    for key in b"j" * 30 + b"k" * 10:
        moves.append(terminal.key(bytes([key])))
    cpu = (terminal.cpu_s() - before) / len(moves)
    keys = b"4jjj +-3452342616"
    before = terminal.cpu_s()
    for key in keys:
        switches.append(terminal.key(bytes([key])))
    cpu_steps = (terminal.cpu_s() - before) / len(keys)
    terminal.key(b"3")
    idle = len(terminal.read(timeout=3.0)[0])
    before = terminal.cpu_s()
    time.sleep(3)
    idle += len(terminal.read(timeout=1.0)[0])
    idle_cpu = terminal.cpu_s() - before
    terminal.stop()
    print(f"{width} x {height}, {OPTIONS} options and {PATHS} paths loaded:")
    sizes = sorted(size for size, _ in moves)
    print(f"  bytes for a cursor move in the causes: median {sizes[len(sizes) // 2]}, most {sizes[-1]} (bar 2000)")
    steps = sorted(size for size, _ in switches if size)
    print(f"  bytes for steps and basket: median {steps[len(steps) // 2]}, most {steps[-1]}")
    print(f"  key to repaint, cursor: {_times(moves)}; {1000 * cpu:.0f} ms of processor")
    print(f"  key to repaint, steps and basket: {_times(switches)}; {1000 * cpu_steps:.0f} ms of processor")
    print(f"  idle for 3 s: {idle} bytes, {1000 * idle_cpu:.0f} ms of processor")


def _times(measured: Sequence[tuple[int, float]]) -> str:
    seconds = sorted(s for n, s in measured if n)
    p95 = seconds[min(int(0.95 * len(seconds)), len(seconds) - 1)]
    return f"median {1000 * statistics.median(seconds):.0f} ms, p95 {1000 * p95:.0f} ms (bar 50 ms)"


if __name__ == "__main__":
    serve_made() if os.environ.get("CARE_BENCHMARK") else main()

"""The walk over a slow link: is a key lost or doubled, do frames queue up, does a held arrow stop when it is released?

    python -m benchmarks.slow_link [--ms 200] [--kbit 64] [--hold 3] [--silent]

Drives the real program in a pseudo-terminal through a proxy that delays either way by half of `--ms` and lets `--kbit`
through to the screen. An arrow key is held as a keyboard repeats it, 30 times a second, and released; then single keys
are typed faster than frames come. The proxy answers as a terminal does, when it has shown what came before; `--silent`:
as one that never answers. Printed are the keys that were sent and the rows that the cursor moved, the seconds from the
release to the last byte on the screen, and the bytes a frame.
"""

from __future__ import annotations

import argparse
import os
import re
import select
import sys
import time
from collections import deque
from fcntl import ioctl
from struct import pack
from termios import TIOCSWINSZ

from benchmarks.tui import Terminal
from care_tui.link import ASK

DOWN, UP = b"\x1b[B", b"\x1b[A"
REPEAT_HZ = 30
MOST_AFTER_S = 1.0
"""From the release: the way of the last key, of the frame that was under way, and of the last one."""
SELECTED = re.compile("● GROUP\\d\\d_OPTION_(\\d+)".encode())
ANSWER = b"\x1b[1;1R"


class SlowLink:
    """A terminal at the far end of a link: `step` moves bytes both ways as time allows."""

    def __init__(self, terminal: Terminal, delay_s: float, bytes_a_s: float, *, silent: bool) -> None:
        self.terminal, self.delay_s, self.bytes_a_s, self.silent = terminal, delay_s, bytes_a_s, silent
        self.typed: deque[tuple[float, bytes]] = deque()
        self.under_way: deque[tuple[float, bytes]] = deque()
        self.free_s = time.perf_counter()
        self.shown = b""
        self.last_shown_s = 0.0
        self.asks = 0

    def type(self, key: bytes) -> None:
        """A key at the far end."""
        self.typed.append((time.perf_counter() + self.delay_s, key))

    def step(self, wait_s: float = 0.002) -> None:
        """Take as many bytes from the program as the link has room for, show and type what has arrived."""
        now = time.perf_counter()
        if self.free_s <= now:
            ready, _, _ = select.select([self.terminal.fd], [], [], wait_s)
            if ready:
                part = os.read(self.terminal.fd, 256)
                self.free_s = max(now, self.free_s) + len(part) / self.bytes_a_s
                self.under_way.append((self.free_s + self.delay_s, part))
        else:
            time.sleep(min(wait_s, self.free_s - now))
        now = time.perf_counter()
        while self.under_way and self.under_way[0][0] <= now:
            self._show(self.under_way.popleft()[1])
        while self.typed and self.typed[0][0] <= now:
            os.write(self.terminal.fd, self.typed.popleft()[1])

    def _show(self, part: bytes) -> None:
        self.shown += part
        self.last_shown_s = time.perf_counter()
        asks = self.shown.count(ASK.encode())
        if not self.silent:
            for _ in range(asks - self.asks):
                self.type(ANSWER)
        self.asks = asks

    def run(self, seconds: float) -> None:
        """Let time pass."""
        until = time.perf_counter() + seconds
        while time.perf_counter() < until:
            self.step()

    def settle(self, quiet_s: float = 1.5) -> None:
        """Until nothing was shown for so long."""
        self.last_shown_s = time.perf_counter()
        while time.perf_counter() - self.last_shown_s < quiet_s:
            self.step()


def selected_row(link: SlowLink, height: int) -> int:
    """The number of the option that the cursor is on: the pane beside the list names it, drawn anew."""
    at = len(link.shown)
    ioctl(link.terminal.fd, TIOCSWINSZ, pack("HHHH", height, 121, 0, 0))
    os.kill(link.terminal.process.pid, 28)
    link.settle()
    found = SELECTED.findall(re.sub(rb"\x1b\[[0-9;?]*[a-zA-Z]", b"", link.shown[at:]))
    if not found:
        raise SystemExit("the screen names no option")
    return int(found[-1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ms", type=float, default=200.0, help="there and back")
    parser.add_argument("--kbit", type=float, default=64.0, help="a second, to the screen")
    parser.add_argument("--hold", type=float, default=3.0, help="seconds that the key is held")
    parser.add_argument("--silent", action="store_true", help="a terminal that answers no question")
    args = parser.parse_args()
    os.environ["SSH_CONNECTION"] = "192.0.2.1 50000 192.0.2.2 22"  # what the program tells a link by
    terminal = Terminal.start([sys.executable, "-m", "benchmarks.tui"], 120, 40)
    link = SlowLink(terminal, args.ms / 2000, args.kbit * 1000 / 8, silent=args.silent)
    while b"FAULT" not in link.shown:
        link.step()
    link.settle()
    link.type(b"3")
    link.settle()
    before = len(link.shown)
    pressed = 0
    began = time.perf_counter()
    while time.perf_counter() - began < args.hold:
        link.type(DOWN)
        pressed += 1
        link.run(max(0.0, began + pressed / REPEAT_HZ - time.perf_counter()))
    released = time.perf_counter()
    link.settle()
    after_s, frames = link.last_shown_s - released, link.shown[before:].count(ASK.encode())
    sent = len(link.shown) - before
    row = selected_row(link, 41)
    for _ in range(10):
        link.type(UP)
        link.run(0.02)
    link.settle()
    back = selected_row(link, 40)
    terminal.stop()
    kept = row == pressed and back == pressed - 10 and (after_s <= MOST_AFTER_S or args.silent)
    bar = "no bar for one that is silent" if args.silent else f"at most {MOST_AFTER_S:g}"
    print(f"{args.ms:g} ms, {args.kbit:g} kbit/s, {'a silent' if args.silent else 'an answering'} terminal:")
    print(f"  {pressed} presses of a held arrow: the cursor moved {row} rows; 10 back: {row - back}")
    print(f"  {sent} bytes, {frames} questions while it was held")
    print(f"  {'kept  ' if kept else 'MISSED'} still {after_s:.2f} s after the release, {bar}")


if __name__ == "__main__":
    main()

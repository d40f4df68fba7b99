"""The walk of a new user, key by key, as a terminal shows it: writes docs/walk.md. Needs tmux.

python -m benchmarks.tools.walk [FILE]
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from care_core.files import bundled, write_atomically
from care_core.records import Record, Struct, field

SAMPLE = "arducopter_failed.BIN"
WIDTH, HEIGHT = 80, 24
PATIENCE_S = 30.0

INTRODUCTION = f"""# A walk through the app

A new user has a failed flight, `{SAMPLE}`, and the one command `care`. Every screen below is what a terminal of
{WIDTH} x {HEIGHT} showed (blank lines at its end are left out); `python -m benchmarks.tools.walk` takes them again.
"""


class Step(Record):
    """A key with what it is for, and a text that tells that its work is done."""

    keys: tuple[str, ...]
    until: str
    about: str


WALK = (
    Step(
        (f"care {SAMPLE}", "Enter"),
        "Distribution",
        "The log is read, and the app stands at the first objective outside its threshold.",
    ),
    Step(("1",), "came down 10 m", "What happened? Findings first, then the timeline of the flight."),
    Step(("p",), "60", "p shows the signal that proves what is under the cursor, at its moment, its time shaded."),
    Step(("M",), "its corners", "The map: where it went, and the way that it was asked to go."),
    Step(("2",), "Distribution", "A digit leaves the views, back to the objectives."),
    Step(
        ("Enter",),
        "height above home",
        "What caused it? What this run shows comes first, with the signal that proves it; the path stands below.",
    ),
    Step(("Enter",), "What to change", "What to change, and what that is predicted to bring."),
    Step(("=", "20", "Enter"), "16 → 20", "What if it were 20? The odds follow: that is not enough."),
    Step(("u",), "16 → 40", "u takes it back."),
    Step(("Enter",), "Commands that do it", "What would change in the configuration, and how to change it."),
    Step(("Enter",), "schema: care.triage", "The report as it will be written; f turns it into Markdown."),
    Step(("f",), "# Triage", "Markdown for the ticket."),
    Step(("Enter",), "Write the report to", "Where to? The name that is offered will do."),
    Step(("Enter",), "written to", "Written."),
    Step(("?",), "Help and keys", "At any time: which keys work here?"),
    Step(("Escape", "q"), "$", "Back in the shell. The exit code is 1, for a fault was found."),
    Step(("echo $?; head -5 *.md", "Enter"), "# Triage", "The report is there."),
)


class Terminal(Struct, eq=False):
    """A tmux of its own with a plain shell in it."""

    folder: Path
    name: str = field(default_factory=lambda: f"care-walk-{os.getpid()}")

    def start(self) -> None:
        care = f"{shlex.quote(sys.executable)} -m care_tui"
        root = Path(__file__).parents[2]
        (self.folder / "rc").write_text(f"PS1='$ '\ncare() {{ PYTHONPATH={shlex.quote(str(root))} {care} \"$@\"; }}\n")
        shell = f"env XDG_CONFIG_HOME=. XDG_STATE_HOME=. CARE_HISTORY=off bash --rcfile {self.folder / 'rc'} -i"
        flights = self.folder / "flights"
        flights.mkdir()
        shutil.copy(bundled("samples", SAMPLE), flights)
        self._tmux("new-session", "-d", "-x", str(WIDTH), "-y", str(HEIGHT), "-c", str(flights), shell)

    def press(self, keys: tuple[str, ...]) -> None:
        for key in keys:
            self._tmux("send-keys", key)
            time.sleep(0.3)

    def screen(self, until: str) -> str:
        """What is shown once `until` is there and nothing moves any more."""
        before, deadline = "", time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            time.sleep(0.5)
            now = self._tmux("capture-pane", "-p")
            if until in now and now == before:
                return "\n".join(line.rstrip() for line in now.rstrip().splitlines())
            before = now
        raise SystemExit(f"'{until}' was not shown:\n{before}")

    def stop(self) -> None:
        self._tmux("kill-server")

    def _tmux(self, *arguments: str) -> str:
        command = ["tmux", "-L", self.name, "-f", os.devnull, *arguments]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def taken() -> str:
    """The whole walk as Markdown."""
    parts = [INTRODUCTION]
    with tempfile.TemporaryDirectory() as folder:
        terminal = Terminal(Path(folder))
        terminal.start()
        terminal.screen("$")
        try:
            for number, step in enumerate(WALK, start=1):
                terminal.press(step.keys)
                keys = ", ".join(f"`{key}`" for key in step.keys)
                parts.append(f"## {number}. {keys}\n\n{step.about}\n\n```\n{terminal.screen(step.until)}\n```\n")
        finally:
            terminal.stop()
    return "\n".join(parts)


def main() -> None:
    """Write docs/walk.md or the file that is named."""
    file = Path(sys.argv[1] if len(sys.argv) > 1 else "docs/walk.md")
    write_atomically(file, taken())
    print(file)


if __name__ == "__main__":
    main()

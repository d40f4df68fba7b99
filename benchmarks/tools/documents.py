"""The commands in README.md and docs/, run as they stand: `make docs` puts in what they print.

python -m benchmarks.tools.documents [FILE...]

A fenced block whose first line begins with `$ ` is a session: its commands run in order, all of one document in one
empty folder that holds `samples/`, and what each prints follows it, data before talk. A block after the line
`<!-- not run: REASON -->` is left as it is: it needs a robot, the network or hours. One after `<!-- takes minutes -->`
is renewed here, and its commands are tested with less work.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from benchmarks.tools.tables import with_tables
from care_core.files import bundled, write_atomically
from care_core.records import Record

ROOT = Path(__file__).parents[2]
WRITTEN_ELSEWHERE = {"checks.md", "extractors.md", "walk.md"}
DOCUMENTS = (
    ROOT / "README.md",
    *(path for path in sorted((ROOT / "docs").rglob("*.md")) if path.name not in WRITTEN_ELSEWHERE),
)

_BLOCK = re.compile(r"(?P<before>[^\n]*)\n```[a-z]*\n(?P<session>\$ .*?)^```$", re.DOTALL | re.MULTILINE)
_NOT_RUN = "<!-- not run"
_SLOW = "<!-- takes minutes"
_LIMIT_S, _SLOW_LIMIT_S = 120.0, 3600.0


class Session(Record):
    """A block of commands of a document, at [start, end) of its text."""

    start: int
    end: int
    written: str

    @property
    def commands(self) -> list[str]:
        """What stands behind the `$ ` of each command; a backslash goes on in the next line."""
        joined = self.written.replace("\\\n", "\\\0")
        return [line[2:].replace("\0", "\n") for line in joined.splitlines() if line.startswith("$ ")]


def sessions(text: str, *, slow: bool = False) -> Iterator[Session]:
    """The sessions of a document that are run; `slow`: those too that take minutes."""
    for block in _BLOCK.finditer(text):
        if not block["before"].startswith(_NOT_RUN if slow else (_NOT_RUN, _SLOW)):
            yield Session(block.start("session"), block.end("session"), block["session"])


def played(session: Session, folder: Path, limit_s: float = _LIMIT_S) -> str:
    """The session with what its commands print in a folder, both streams as a terminal shows them."""
    lines = []
    for command in session.commands:
        lines += [f"$ {command}", printed(command, folder, limit_s).rstrip("\n")]
    return "".join(f"{line}\n" for line in lines if line)


def printed(command: str, folder: Path, limit_s: float = _LIMIT_S) -> str:
    """What a command prints in a terminal of 80 columns, without its progress. Raises TimeoutExpired."""
    environment = {
        **os.environ,
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "COLUMNS": "80",
        "NO_COLOR": "1",
        "XDG_DATA_HOME": str(folder / ".data"),
        "XDG_CONFIG_HOME": str(folder / ".config"),
        "PYTHONPATH": os.pathsep.join((str(ROOT), str(ROOT / "samples"))),
    }
    ended = subprocess.run(
        ("bash", "-c", command), cwd=folder, env=environment, capture_output=True, text=True, encoding="utf-8",
        stdin=subprocess.DEVNULL, timeout=limit_s, check=False,
    )  # fmt: skip
    talk = [line for line in ended.stderr.splitlines(keepends=True) if not line.rstrip().endswith(" ...")]
    return ended.stdout + "".join(talk)


def prepare(folder: Path) -> None:
    """What a new user has: the bundled samples."""
    (folder / "samples").symlink_to(bundled("samples"), target_is_directory=True)


def renewed(text: str) -> str:
    """A document with what its commands print now, and its tables."""
    text = with_tables(text)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        prepare(folder)
        parts, done = [], 0
        for session in sessions(text, slow=True):
            parts += [text[done : session.start], played(session, folder, _SLOW_LIMIT_S)]
            done = session.end
        return "".join((*parts, text[done:]))


def main(names: list[str]) -> None:
    """Renew the named documents, or all."""
    for path in map(Path, names) if names else DOCUMENTS:
        before = path.read_text(encoding="utf-8")
        after = renewed(before)
        if after != before:
            write_atomically(path, after)
            print(f"renewed {path}")


if __name__ == "__main__":
    main(sys.argv[1:])

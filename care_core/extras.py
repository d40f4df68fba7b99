"""What the program can be installed with, and the command that adds it to this very installation."""

from __future__ import annotations

import os
import shlex
import sys
from pathlib import Path

from care_core.starting import interpreter

DISTRIBUTION = "care-tui"
EXTRAS = {
    "learn": "train profiles, write Parquet",
    "mcp": "answer an assistant (care mcp)",
    "serve": "the app in a browser",
    "fleet": "triage many logs on several computers",
}
"""What an extra is for; one that is not named here speaks for itself."""


def install_command(extra: str = "") -> str:
    """The command that adds an extra to the environment that runs; without one, that repairs it.

    A plain `pip` is right only in the environment that a shell has activated: it is another one's elsewhere, and Debian
    and Ubuntu refuse to let it into theirs.
    """
    wanted = shlex.quote(f"{DISTRIBUTION}[{extra}]") if extra else f"--force-reinstall {DISTRIBUTION}"
    here = Path(sys.prefix)
    if (here / "uv-receipt.toml").is_file():
        again = wanted if extra else f"--reinstall {DISTRIBUTION}"
        return f"uv pip install --python {shlex.quote(interpreter())} {again}"
    if (here / "pipx_metadata.json").is_file():
        return f"pipx runpip {DISTRIBUTION} install {wanted}"
    is_active = os.environ.get("VIRTUAL_ENV") == sys.prefix
    return f"{'' if is_active else f'{shlex.quote(interpreter())} -m '}pip install {wanted}"


def install_hint(extra: str) -> str:
    """What to do where an extra is missing, without its full stop: more may follow."""
    return f"Install what it needs with: {install_command(extra)}"

"""Where the files that come with the program are: inside the package when installed, beside it in a checkout."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

_PACKAGE = Path(__file__).parent


def bundled(kind: Literal["profiles", "samples"], name: str = "") -> Path:
    """The path of a bundled profile or sample, or of the folder that holds them all; it may not exist."""
    checkout = _PACKAGE.parent
    folder = checkout / kind if (checkout / "pyproject.toml").is_file() else _PACKAGE / f"_{kind}"
    return folder / name if name else folder

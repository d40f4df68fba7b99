"""A stranger's folder of logs: beside them lies a file for every name that Python could import, and each tells when it
is run."""

from __future__ import annotations

import os
import sys
from collections.abc import Collection
from importlib.metadata import packages_distributions
from pathlib import Path

OWN = ("care_tui", "care_core", "care_samples", "sitecustomize", "usercustomize", "yaml", "linecache")
MARK = "ran"


def plant(folder: Path, but: Collection[str] = ()) -> Path:
    """Put the files into a folder; answers the file in which they tell that they were run."""
    mark = folder / MARK
    code = f"open({str(mark)!r}, 'a').write(__name__ + '\\n')\n"
    folder.mkdir(exist_ok=True)
    own = folder / "multiprocessing.py"
    own.write_text(code)
    names = {*OWN, *sys.stdlib_module_names, *packages_distributions()} - {*but}
    for name in names:
        if name.isidentifier() and not (folder / f"{name}.py").exists():
            os.link(own, folder / f"{name}.py")
    for name in ("care_tui", "care_core"):
        (folder / name).mkdir(exist_ok=True)
        for file in ("__init__.py", "__main__.py", "start.py"):
            os.link(own, folder / name / file)
    for name in ("tmux", "git", "python3", "sh", "xdg-open", "env", "fc-list", "lscpu"):
        program = folder / name
        program.write_text(f"#!/bin/sh\necho {name} >> '{mark}'\n")
        program.chmod(0o755)
    return mark


def what_ran(mark: Path) -> list[str]:
    """What of the folder was run."""
    return mark.read_text().split() if mark.exists() else []

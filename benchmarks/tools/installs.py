"""Each way to install, as the README has it: `python -m benchmarks.tools.installs [--only venv] [--archives FOLDER]`.

`uv tool`, `pipx` and a venv install from the sources, each for a home folder that is empty. Archives of `make offline`
for this machine are unpacked and installed in a namespace that has no network, not even a loopback. Printed are the
seconds, the size of what was installed, and whether `care --version` and `care demo` then work. What is not here (uv,
pipx, a Python) is said. With the home folder the caches of downloads are empty, too.
"""

from __future__ import annotations

import argparse
import os
import platform
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from benchmarks.tools.matrix import ROOT

WITHOUT_NETWORK = ("unshare", "--map-root-user", "--net")
WAYS = ("uv", "pipx", "venv")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--only", default=",".join((*WAYS, "offline")), help="ways, with commas")
    parser.add_argument("--archives", type=Path, default=ROOT / "dist" / "offline")
    parser.add_argument("--python", default=sys.executable, help="for the ways that take the sources")
    args = parser.parse_args()
    only, failures = args.only.split(","), 0
    for way in (one for one in WAYS if one in only):
        failures += tried(way, *_commands(way, args.python))
    here = platform.machine()
    for archive in sorted(args.archives.glob(f"*-{here}.tar.gz")) if "offline" in only else ():
        failures += offline(archive)
    sys.exit(min(failures, 1))


def _commands(way: str, python: str) -> tuple[str, Sequence[Sequence[str]], str]:
    """What must be there, the commands of the README, and where `care` is then; `~` is the empty home folder."""
    source = str(ROOT)
    if way == "uv":
        return "uv", (("uv", "tool", "install", "--python", python, source),), "~/.local/bin/care"
    if way == "pipx":
        return "pipx", (("pipx", "install", "--python", python, source),), "~/.local/bin/care"
    steps = ((python, "-m", "venv", "~/care"), ("~/care/bin/pip", "install", "--quiet", source))
    return python, steps, "~/care/bin/care"


def tried(way: str, needs: str, steps: Sequence[Sequence[str]], care: str, before: Sequence[str] = ()) -> bool:
    """Install in an empty home folder, run, and print a row; whether that failed."""
    if shutil.which(needs) is None:
        print(f"{way:<28} not tried: {needs} is not here", flush=True)
        return False
    with tempfile.TemporaryDirectory(prefix="care-install-") as home:
        own = {"HOME": home, "XDG_DATA_HOME": f"{home}/.local/share", "UV_LINK_MODE": "copy"}
        environment = {**os.environ, **own, "PATH": f"{home}/.local/bin{os.pathsep}{os.environ['PATH']}"}
        for name in ("PYTHONPATH", "VIRTUAL_ENV", "PIPX_HOME", "PIPX_BIN_DIR", "XDG_BIN_HOME", "XDG_CACHE_HOME"):
            environment.pop(name, None)
        began_s = time.monotonic()
        for step in steps:
            words = [word.replace("~", home) for word in step]
            done = subprocess.run(words, cwd=home, env=environment, capture_output=True, text=True, check=False)
            if done.returncode:
                print(f"{way:<28} FAILED: {' '.join(words)}: {done.stderr.strip()[-400:]}", flush=True)
                return True
        took_s = time.monotonic() - began_s
        shutil.rmtree(Path(home) / ".cache", ignore_errors=True)
        size_mb = sum(path.lstat().st_size for path in Path(home).rglob("*") if path.is_file()) / 1e6
        command = [*before, care.replace("~", home)]
        for word, expected in (("--version", 0), ("demo", 1)):
            ended = subprocess.run(
                [*command, word], cwd=home, env=environment, capture_output=True, text=True, check=False
            )
            if ended.returncode != expected:
                print(f"{way:<28} FAILED: care {word} ended with {ended.returncode}: {ended.stderr[-400:]}", flush=True)
                return True
    print(f"{way:<28} {took_s:4.0f} s  {size_mb:4.0f} MB  care --version and care demo work", flush=True)
    return False


def offline(archive: Path) -> bool:
    """Unpack an archive, and install and run it in a namespace without a network; whether that failed."""
    (python,) = re.findall(r"-python(\d\.\d+)-", archive.name)
    # A Python that a version manager only names is none.
    found = shutil.which(f"python{python}")
    if found is None or subprocess.run([found, "--version"], capture_output=True, check=False).returncode:
        print(f"offline, Python {python:<12} not tried: this Python is not here", flush=True)
        return False
    with tempfile.TemporaryDirectory(prefix="care-offline-") as made:
        with tarfile.open(archive) as opened:
            opened.extractall(made, filter="data")
        (folder,) = Path(made).iterdir()
        steps = ((*WITHOUT_NETWORK, str(folder / "install.sh")),)
        return tried(f"offline, Python {python}", "unshare", steps, "~/.local/bin/care", WITHOUT_NETWORK)


if __name__ == "__main__":
    main()

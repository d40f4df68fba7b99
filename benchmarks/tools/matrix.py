"""The package on every Python it is for: `python -m benchmarks.tools.matrix [--only 3.12]`.

Builds the wheel and the source archive once. Each is installed, base dependencies alone, into a bare environment of
each Python that is found (`python3.10` to `python3.13` on the path), where `care --version` must work and `care demo`
must find its fault. Printed are the outcome and the size of the installation against its bar of 420 MB. Then every base
dependency must have a wheel for aarch64, which the computers of robots are: nothing is compiled on one.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
PYTHONS = ("3.10", "3.11", "3.12", "3.13")
PLATFORMS = ("manylinux2014_aarch64", "manylinux_2_28_aarch64")
MOST_MB = 420
QUIET = ("--quiet", "--disable-pip-version-check")


class Outcome(NamedTuple):
    """`failed` is empty where all went well; `size_mb` is that of the installed packages."""

    failed: str
    size_mb: float = 0.0


def run(*words: str | Path) -> subprocess.CompletedProcess[str]:
    """Run a command away from the sources. Pythons are isolated (-I): what lies in that folder is nobody's module."""
    return subprocess.run([*map(str, words)], capture_output=True, text=True, check=False, cwd=tempfile.gettempdir())


def built(folder: Path) -> list[Path]:
    """The wheel and the source archive. Raises RuntimeError where they cannot be built."""
    made = run(sys.executable, "-I", "-m", "build", "--outdir", folder, ROOT)
    if made.returncode:
        raise RuntimeError(made.stdout[-1000:] + made.stderr[-1000:])
    return [*folder.glob("*.whl"), *folder.glob("*.tar.gz")]


def installed(python: str, archive: Path, folder: Path) -> Outcome:
    """What becomes of an archive in a bare environment of a Python."""
    # A Python that a version manager only names is none.
    if shutil.which(f"python{python}") is None or run(f"python{python}", "--version").returncode:
        return Outcome("this Python is not here")
    steps: tuple[tuple[tuple[str | Path, ...], int], ...] = (
        ((f"python{python}", "-I", "-m", "venv", folder), 0),
        ((folder / "bin" / "python", "-I", "-m", "pip", "install", *QUIET, archive), 0),
        ((folder / "bin" / "care", "--version"), 0),
        ((folder / "bin" / "care", "demo"), 1),
    )
    for words, expected in steps:
        done = run(*words)
        if done.returncode != expected:
            return Outcome(
                f"{Path(words[0]).name} {words[1]} ended with {done.returncode}: {done.stderr.strip()[-200:]}"
            )
    packages = next((folder / "lib").glob("python*")) / "site-packages"
    # pip is the environment's own, no part of the installation.
    files = (path for path in packages.rglob("*") if path.is_file() and path.relative_to(packages).parts[0] != "pip")
    size_mb = sum(path.stat().st_size for path in files) / 1e6
    return Outcome("" if size_mb <= MOST_MB else f"more than {MOST_MB} MB", size_mb)


def without_wheel(python: str, wheel: Path, folder: Path) -> str:
    """What pip says where a base dependency has no wheel for aarch64; empty where all have."""
    platforms = [word for platform in PLATFORMS for word in ("--platform", platform)]
    found = run(sys.executable, "-I", "-m", "pip", "download", *QUIET, "--only-binary=:all:", *platforms,
                "--python-version", python, "--dest", folder, wheel)  # fmt: skip
    missing = re.findall(r"No matching distribution found for (\S+)", found.stderr)
    return ", ".join(missing) or ("" if found.returncode == 0 else found.stderr.strip()[-200:])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--only", default=",".join(PYTHONS), help="versions of Python, with commas")
    pythons = parser.parse_args().only.split(",")
    failures = 0
    with tempfile.TemporaryDirectory(prefix="care-matrix-") as made:
        folder = Path(made)
        archives = built(folder / "dist")
        for python in pythons:
            for archive in archives:
                place = folder / f"{python}-{archive.suffix}"
                outcome = installed(python, archive, place)
                shutil.rmtree(place, ignore_errors=True)
                failures += bool(outcome.failed)
                kind = "wheel" if archive.suffix == ".whl" else "sdist"
                print(f"Python {python:<5} {kind}  {outcome.size_mb:4.0f} MB  {outcome.failed or 'works'}", flush=True)
            missing = without_wheel(python, archives[0], folder / f"{python}-aarch64")
            failures += bool(missing)
            print(f"Python {python:<5} aarch64         {missing or 'a wheel for each'}", flush=True)
    sys.exit(min(failures, 1))


if __name__ == "__main__":
    main()

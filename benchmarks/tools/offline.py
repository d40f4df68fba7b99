"""Archives that install without a network: `python -m benchmarks.tools.offline [--python 3.12] [--machine aarch64]`.

One for each Python from 3.10 to 3.13 and each machine that robots and laptops have, into `dist/offline/`: the wheels
of the program and of all that it needs, their checksums, and `install.sh`. The same sources and the same wheels give
the same bytes. A wheel for another Python or machine than the archive's is an error.
"""

from __future__ import annotations

import argparse
import gzip
import hashlib
import io
import re
import subprocess
import sys
import tarfile
import tempfile
import time
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmarks.tools.matrix import PYTHONS, ROOT

MACHINES = ("x86_64", "aarch64")
LIBCS = ("manylinux2014", "manylinux_2_17", "manylinux_2_24", "manylinux_2_26", "manylinux_2_27", "manylinux_2_28")
"""C libraries up to that of Ubuntu 20.04 and Debian 10, which later ones can take the place of."""

INSTALL = """\
#!/bin/sh
# Installs CaRE TUI {version} for Python {python} without a network: ./install.sh [FOLDER]
set -eu
cd "$(dirname "$0")"
python=${{PYTHON:-python{python}}}; folder=${{1:-$HOME/.local/share/care-tui}}; bin=$HOME/.local/bin
fail() {{ echo "$1" >&2; exit 2; }}
[ "$(uname -m)" = {machine} ] || fail "This archive is for {machine}, and this machine is $(uname -m)."
"$python" -c 'import sys; sys.exit(sys.version_info[:2] != ({tuple}))' ||
    fail "This archive is for Python {python}; name yours: PYTHON=/path/to/python{python} ./install.sh"
sha256sum --check --quiet SHA256SUMS
"$python" -m venv --without-pip "$folder"
"$folder/bin/python" "$(echo wheels/pip-*.whl)/pip" --isolated install --quiet --no-index --find-links wheels '{wanted}'
mkdir -p "$bin" && ln -sf "$folder/bin/care" "$bin/care"
"$folder/bin/care" --version && echo "Installed. If your shell does not find 'care', put $bin into PATH."
"""
"""The pip is the archive's own: Debian's and Ubuntu's Python has none without more packages."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--python", default=",".join(PYTHONS), help="versions of Python, with commas")
    parser.add_argument("--machine", default=",".join(MACHINES), help="machines, with commas")
    parser.add_argument("--extras", default="", help="extras that are put in, with commas")
    parser.add_argument("--out", type=Path, default=ROOT / "dist" / "offline")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="care-offline-") as made:
        wheel = own_wheel(Path(made) / "dist")
        for python in args.python.split(","):
            for machine in args.machine.split(","):
                began_s = time.monotonic()
                folder = Path(made) / f"{python}-{machine}"
                wheels = downloaded(wheel, args.extras, python, machine, folder)
                if strange := [one.name for one in wheels if not fits(one.name, python, machine)]:
                    sys.exit(f"not for Python {python} on {machine}: {', '.join(strange)}")
                path = args.out / f"{wheel.name.split('-py3')[0]}-offline-python{python}-{machine}.tar.gz"
                path.write_bytes(packed(wheels, wheel, args.extras, python, machine))
                took_s = time.monotonic() - began_s
                print(f"{path}  {path.stat().st_size / 1e6:.0f} MB, {len(wheels)} wheels, {took_s:.0f} s", flush=True)


def own_wheel(folder: Path) -> Path:
    """The program's wheel, made by pip alone: the bytes that a package index gets. Ends the program where it fails."""
    words = [sys.executable, "-I", "-m", "pip", "wheel", "--quiet", "--disable-pip-version-check", "--no-deps"]
    done = subprocess.run([*words, "--wheel-dir", str(folder), str(ROOT)], capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"no wheel: {done.stderr.strip()[-600:]}")
    return next(folder.glob("*.whl"))


def downloaded(wheel: Path, extras: str, python: str, machine: str, folder: Path) -> list[Path]:
    """The wheels that a Python on a machine needs, and pip. Ends the program where one of them has none."""
    wanted = f"{wheel}[{extras}]" if extras else str(wheel)
    platforms = [word for libc in LIBCS for word in ("--platform", f"{libc}_{machine}")]
    words = [sys.executable, "-I", "-m", "pip", "download", "--quiet", "--disable-pip-version-check"]
    words += ["--only-binary=:all:", *platforms, "--python-version", python, "--dest", str(folder), wanted, "pip"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"Python {python} on {machine}: {done.stderr.strip()[-600:]}")
    return sorted(folder.glob("*.whl"))


def fits(name: str, python: str, machine: str) -> bool:
    """Whether a wheel is for a Python and a machine, by the tags of its name."""
    tag, abi, platform = name.removesuffix(".whl").split("-")[-3:]
    number = int(python.replace("3.", ""))
    is_any = platform == "any"
    if not is_any and not all(one.endswith(f"_{machine}") for one in platform.split(".")):
        return False
    pythons = {f"cp3{number}", f"py3{number}", "py3", *(f"cp3{one}" for one in range(2, number) if abi == "abi3")}
    return bool(pythons & set(tag.split(".")))


def packed(wheels: Sequence[Path], own: Path, extras: str, python: str, machine: str) -> bytes:
    """The archive: the same files give the same bytes, whoever made them and when."""
    version = own.name.split("-")[1]
    name = "care-tui"
    text = INSTALL.format(
        version=version, python=python, machine=machine, tuple=python.replace(".", ", "),
        wanted=f"{name}[{extras}]" if extras else name,
    )  # fmt: skip
    folder = f"{own.name.split('-py3')[0]}-python{python}-{machine}"
    sums = "".join(f"{hashlib.sha256(one.read_bytes()).hexdigest()}  wheels/{one.name}\n" for one in wheels)
    made = io.BytesIO()
    with (
        gzip.GzipFile(fileobj=made, mode="wb", mtime=0, compresslevel=1) as zipped,  # wheels are packed already
        tarfile.open(fileobj=zipped, mode="w") as archive,
    ):
        for path, content, mode in (
            ("install.sh", text.encode(), 0o755),
            ("SHA256SUMS", sums.encode(), 0o644),
            ("README.md", b"".join(_page(own)), 0o644),
            *((f"wheels/{one.name}", one.read_bytes(), 0o644) for one in wheels),
        ):
            entry = tarfile.TarInfo(f"{folder}/{path}")
            entry.size, entry.mode = len(content), mode
            archive.addfile(entry, io.BytesIO(content))
    return made.getvalue()


def _page(wheel: Path) -> Iterator[bytes]:
    """The program's page, as its wheel has it: without links that lead nowhere here."""
    with zipfile.ZipFile(wheel) as opened:
        (name,) = [one for one in opened.namelist() if re.fullmatch(r"[^/]+\.dist-info/METADATA", one)]
        yield opened.read(name).partition(b"\n\n")[2]


if __name__ == "__main__":
    main()

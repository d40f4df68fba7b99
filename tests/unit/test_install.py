"""Which command adds an extra to this installation; archives that install without a network."""

from __future__ import annotations

import io
import os
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

from benchmarks.tools.offline import fits, packed
from care_core.extras import EXTRAS, install_command


@pytest.mark.parametrize(
    ("mark", "expected"),
    [
        ("uv-receipt.toml", f"uv pip install --python {sys.executable} 'care-tui[mcp]'"),
        ("pipx_metadata.json", "pipx runpip care-tui install 'care-tui[mcp]'"),
        ("", f"{sys.executable} -m pip install 'care-tui[mcp]'"),
    ],
    ids=("uv", "pipx", "venv"),
)
def test_an_extra_is_added_by_what_installed_the_program(
    mark: str, expected: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    monkeypatch.delenv("VIRTUAL_ENV", raising=False)
    if mark:
        (tmp_path / mark).touch()
    assert install_command("mcp") == expected


def test_in_an_activated_environment_pip_is_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VIRTUAL_ENV", sys.prefix)
    assert install_command("mcp") == "pip install 'care-tui[mcp]'"
    assert install_command() == "pip install --force-reinstall care-tui"


def test_every_extra_says_what_it_is_for() -> None:
    project = (Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8")
    section = project.partition("[project.optional-dependencies]\n")[2].partition("\n\n")[0]
    named = {line.partition(" =")[0] for line in section.splitlines() if " = [" in line}
    assert named - {"dev"} == EXTRAS.keys()


@pytest.mark.parametrize(
    ("name", "does"),
    [
        ("rich-14.0-py3-none-any.whl", True),
        ("numpy-2.2-cp312-cp312-manylinux_2_17_aarch64.manylinux2014_aarch64.whl", True),
        ("numpy-2.2-cp311-cp311-manylinux_2_17_aarch64.manylinux2014_aarch64.whl", False),
        ("numpy-2.2-cp312-cp312-manylinux_2_17_x86_64.manylinux2014_x86_64.whl", False),
        ("some-1-cp39-abi3-manylinux_2_28_aarch64.whl", True),
        ("some-1-cp313-abi3-manylinux_2_28_aarch64.whl", False),
        ("six-1-py2.py3-none-any.whl", True),
    ],
)
def test_a_wheel_is_for_a_python_and_a_machine(name: str, does: bool) -> None:
    assert fits(name, "3.12", "aarch64") is does


def _wheels(folder: Path) -> list[Path]:
    folder.mkdir()
    own = folder / "care_tui-0.1.0-py3-none-any.whl"
    with zipfile.ZipFile(own, "w") as opened:
        opened.writestr(zipfile.ZipInfo("care_tui-0.1.0.dist-info/METADATA"), "Name: care-tui\n\n# CaRE TUI\n")
    (folder / "pip-25.0-py3-none-any.whl").write_bytes(b"")
    return sorted(folder.iterdir())


def test_the_same_wheels_give_the_same_archive_and_the_page_of_the_program(tmp_path: Path) -> None:
    one, other = _wheels(tmp_path / "one"), _wheels(tmp_path / "other")
    for path in other:
        os.utime(path, (1, 1))
        path.chmod(0o600)
    made = packed(one, one[0], "mcp", "3.12", "aarch64")
    assert made == packed(other, other[0], "mcp", "3.12", "aarch64")
    with tarfile.open(fileobj=io.BytesIO(made)) as archive:
        page = archive.extractfile("care_tui-0.1.0-python3.12-aarch64/README.md")
        assert page is not None
        assert page.read() == b"# CaRE TUI\n"


@pytest.mark.skipif(os.name != "posix", reason="a shell script")
def test_the_install_script_refuses_another_machine_another_python_and_damage(tmp_path: Path) -> None:
    wheels = _wheels(tmp_path / "wheels")
    here = f"{sys.version_info.major}.{sys.version_info.minor}"

    def install(python: str, machine: str, *, damage: bool = False) -> str:
        with tarfile.open(fileobj=io.BytesIO(packed(wheels, wheels[0], "", python, machine))) as archive:
            archive.extractall(tmp_path)
        folder = tmp_path / f"care_tui-0.1.0-python{python}-{machine}"
        if damage:
            (folder / "wheels" / wheels[0].name).write_bytes(b"half")
        words = [str(folder / "install.sh"), str(tmp_path / "there")]
        done = subprocess.run(
            words, env={**os.environ, "PYTHON": sys.executable}, capture_output=True, text=True, check=False
        )
        assert done.returncode
        assert not (tmp_path / "there").exists()
        return done.stderr

    assert "This archive is for vax, and this machine is " in install(here, "vax")
    assert "This archive is for Python 3.99" in install("3.99", os.uname().machine)
    assert "checksum" in install(here, os.uname().machine, damage=True)

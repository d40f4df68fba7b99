"""How interpreters and programs are started: none runs what lies in the folder it is started in."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from care_core.starting import isolated_children, program_path, python_command
from tests.strangers_folder import plant, what_ran

ROOT = Path(__file__).parents[2]
PYTHONS = ("3.10", "3.11", "3.12", "3.13")

PROGRAM = """
import importlib.util, multiprocessing, subprocess, sys
spec = importlib.util.spec_from_file_location("starting", {starting!r})
starting = importlib.util.module_from_spec(spec)
spec.loader.exec_module(starting)
if __name__ == "__main__":
    import theirs  # of an absolute PYTHONPATH, as what `pip install --user` installed is
    with starting.isolated_children(), starting.isolated_children():
        for method in ("spawn", "forkserver"):
            context = multiprocessing.get_context(method)
            context.set_forkserver_preload(["json", "typing"])
            queue = context.Queue()
            process = context.Process(target=theirs.answer, args=(queue,))
            process.start()
            assert queue.get(timeout=60) == 42
            process.join()
            assert process.exitcode == 0
    code = "import json, theirs; assert sys.argv[1:] == ['a b', '-c']; print(theirs.__file__)"
    subprocess.run(starting.python_command(code, "a b", "-c"), check=True)
"""


def _python(release: str) -> str:
    """An interpreter of a release, behind the shims of pyenv as well; skips the test where there is none."""
    found = Path(shutil.which(f"python{release}") or os.devnull)
    behind = found.parents[1].glob(f"versions/{release}.*/bin/python{release}") if len(found.parents) > 1 else []
    for path in (*behind, found):
        if path.is_file() and subprocess.run([path, "--version"], capture_output=True, check=False).returncode == 0:
            return str(path)
    pytest.skip(f"needs Python {release}")


@pytest.mark.parametrize("release", PYTHONS)
def test_children_run_nothing_of_the_folder_they_are_started_in(release: str, tmp_path: Path) -> None:
    """Spawned, forked by a server, the tracker of resources, and by a command; what is installed they all find."""
    installed, folder, script = tmp_path / "installed", tmp_path / "logs", tmp_path / "program.py"
    installed.mkdir()
    (installed / "theirs.py").write_text("def answer(queue):\n    import json, typing\n    queue.put(42)\n")
    script.write_text(PROGRAM.format(starting=str(ROOT / "care_core" / "starting.py")))
    mark = plant(folder)
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    ran = subprocess.run(
        [_python(release), script],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert what_ran(mark) == []
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.strip() == str(installed / "theirs.py")


def test_another_programs_children_are_as_they_were() -> None:
    from multiprocessing import util

    before = util._args_from_interpreter_flags  # type: ignore[attr-defined]
    with isolated_children():
        with isolated_children():
            pass
        assert "-I" in util._args_from_interpreter_flags()  # type: ignore[attr-defined]
    assert util._args_from_interpreter_flags is before  # type: ignore[attr-defined]


def test_a_command_names_no_relative_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", ["", "lib", "/absolute"])
    _, code = python_command("pass")[-2:]
    assert "sys.path[:] = ['/absolute'];" in code


@pytest.mark.parametrize("path", [".:{bin}", ":{bin}", "{bin}:", "logs:{bin}"])
def test_a_helper_program_is_not_looked_for_in_the_current_folder(
    path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    programs = tmp_path / "bin"
    programs.mkdir()
    (programs / "tmux").write_text("#!/bin/sh\n")
    (programs / "tmux").chmod(0o755)
    plant(tmp_path / "logs")
    for folder in (tmp_path, tmp_path / "logs"):
        monkeypatch.chdir(folder)
        monkeypatch.setenv("PATH", path.format(bin=programs))
        assert program_path("tmux") == str(programs / "tmux")
        with pytest.raises(FileNotFoundError):
            program_path("xdg-open")
    assert program_path("./tmux") == "./tmux"


STARTERS = {
    "care_core/starting.py": {"multiprocessing", "subprocess", "sys.executable"},
    "care_core/parallel.py": {"multiprocessing"},
    "care_core/fleet/cluster.py": {"multiprocessing"},
    "care_core/collect/mission.py": {"subprocess", "sys.executable"},  # {python} of the operator's own command
    "care_core/collect/guard.py": {"subprocess"},
    "care_core/application/notifying.py": {"subprocess"},
    "care_core/application/recorder.py": {"subprocess"},
    "care_tui/browser.py": {"subprocess"},
    "care_tui/commands/watching.py": {"subprocess"},
    "care_tui/commands/doctor.py": {"subprocess"},
    "care_tui/web.py": {"textual_serve"},
}
"""What in each module starts processes. `sys.executable` begins the command of an interpreter."""

_MODULES = {"joblib", "multiprocessing", "pexpect", "pty", "runpy", "subprocess", "textual_serve", "webbrowser"}
_NAMES = ("ProcessPoolExecutor", "create_subprocess", "subprocess_", "open_url")
_OF_OS = ("exec", "fork", "popen", "posix_spawn", "spawn", "startfile", "system")


def _starts(tree: ast.AST) -> set[str]:
    """What of a module can start a process."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [node.module or "", *(alias.name for alias in node.names)]
            found |= {name for name in names if node.module == "os" and name.startswith(_OF_OS)}
        elif isinstance(node, ast.Attribute):
            names = [node.attr]
            owner = node.value.id if isinstance(node.value, ast.Name) else ""
            found |= {f"{owner}.{node.attr}"} if owner == "os" and node.attr.startswith(_OF_OS) else set()
            found |= {"sys.executable"} if node.attr == "executable" else set()
        else:
            continue
        found |= {name.partition(".")[0] for name in names} & _MODULES | {n for n in names if n.startswith(_NAMES)}
    return found


def test_no_other_place_starts_a_process() -> None:
    """What is added here starts interpreters by `starting`, and helper programs by a path that it gives."""
    found = {}
    told = re.compile("|".join((*_MODULES, *_NAMES, r"\bos\b", "executable")))  # without any there is nothing to find
    for room in ("care_core", "care_tui"):
        for path in sorted((ROOT / room).rglob("*.py")):
            text = path.read_text(encoding="utf-8")
            starts = _starts(ast.parse(text)) if told.search(text) else set()
            if starts:
                found[str(path.relative_to(ROOT))] = starts
    assert found == STARTERS


@pytest.mark.parametrize(
    "code",
    ["import joblib", "from concurrent.futures import ProcessPoolExecutor", "import os\nos.execv('a', [])",
     "import os\nos.system('a')", "from os import fork", "import asyncio\nasyncio.create_subprocess_exec('a')"],
)  # fmt: skip
def test_the_look_for_such_places_sees_them(code: str) -> None:
    assert _starts(ast.parse(code))

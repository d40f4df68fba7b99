"""What works on this computer: one finding for each thing that `care` needs or can use, with what to do."""

from __future__ import annotations

import os
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

from care_core.errors import CareError
from care_core.extras import DISTRIBUTION, EXTRAS, install_command
from care_core.records import Record
from care_core.text import number_of

Status = Literal["ok", "warn", "fail"]

_DEVELOPMENT = "dev"
_NEWEST_PYTHON = (3, 13)
_LITTLE_BYTES, _NOTHING_BYTES = 200_000_000, 20_000_000
"""Below the one a log unpacked to a temporary file may not fit (the largest recorded one takes 160 MB), below the other
no history."""


class Checked(Record):
    """One thing that was looked at: what is so, and what to do where that is not well."""

    name: str
    status: Status
    says: str
    do: str = ""


def look_over() -> Iterator[Checked]:
    """Everything but the terminal, which the core knows nothing of."""
    yield _python()
    yield from _packages()
    yield from _profiles()
    yield from _folders()
    yield from _room()
    yield _history()


def _python() -> Checked:
    import numpy as np

    version = ".".join(map(str, sys.version_info[:3]))
    says = f"Python {version} on {sys.platform}, numpy {np.__version__}"
    if sys.version_info[:2] > _NEWEST_PYTHON:
        newest = ".".join(map(str, _NEWEST_PYTHON))
        return Checked("python", "warn", f"{says}, newer than was tried", f"Python {newest} is the newest that was.")
    return Checked("python", "ok", says)


def _packages() -> Iterator[Checked]:
    """The packages that were declared at installation: what is needed, and each extra."""
    from importlib.metadata import PackageNotFoundError, requires

    try:
        declared = requires(DISTRIBUTION) or []
    except PackageNotFoundError:
        yield Checked("packages", "warn", f"{DISTRIBUTION} is not installed, it runs from its source",
                      "pip install . in its folder says what is missing.")  # fmt: skip
        return
    wanted: dict[str, list[str]] = {}
    for line in declared:
        name = re.split(r"[^\w.-]", line, maxsplit=1)[0]
        marker = re.search(r"extra\s*==\s*['\"]([\w-]+)['\"]", line)
        if name != DISTRIBUTION:
            wanted.setdefault(marker[1] if marker else "", []).append(name)
    missing = {extra: [name for name in names if not _is_installed(name)] for extra, names in wanted.items()}
    if lost := missing.pop("", []):
        yield Checked("packages", "fail", f"missing: {', '.join(lost)}", install_command())
    else:
        yield Checked("packages", "ok", f"all {len(wanted.get('', ()))} that are needed are installed")
    for extra, lacking in missing.items():
        if extra == _DEVELOPMENT:
            continue
        use = EXTRAS.get(extra, "")
        if lacking:
            yield Checked(f"extra {extra}", "warn", f"not installed{f': {use}' if use else ''} ({', '.join(lacking)})",
                          f"{install_command(extra)} where you need it.")  # fmt: skip
        else:
            yield Checked(f"extra {extra}", "ok", f"installed{f': {use}' if use else ''}")


def _is_installed(distribution: str) -> bool:
    from importlib.metadata import PackageNotFoundError, version

    try:
        version(distribution)
    except PackageNotFoundError:
        return False
    return True


def _profiles() -> Iterator[Checked]:
    from care_core.application.scaffolding import is_trained
    from care_core.errors import ProfileError
    from care_core.profile.check import problems
    from care_core.profile.store import available_profiles, load_profile

    sound, folders = [], available_profiles()
    for folder in folders:
        try:
            profile = load_profile(folder)
            if not is_trained(profile):
                advice = f"'care profiles check {folder.name}' says what is missing."
                yield Checked(f"profile {folder.name}", "warn", "not trained yet", advice)
                continue
            found = problems(profile)
        except ProfileError as err:
            found = (str(err),)
        if found:
            advice = f"Look with 'care profiles check {folder.name}'."
            yield Checked(f"profile {folder.name}", "fail", found[0], advice)
        else:
            sound.append(folder.name)
    if not folders:
        yield Checked("profiles", "fail", "there is none", install_command())
    elif sound:
        yield Checked("profiles", "ok", f"{len(sound)} load and agree with themselves: {', '.join(sound)}")


def _places() -> dict[str, Path]:
    from platformdirs import user_config_path, user_state_path

    from care_core.history.store import history_path

    history = history_path()
    places = {"settings": user_config_path("care"), "recent logs": user_state_path("care")}
    if history is not None:
        places["history"] = history.parent
    return {**places, "temporary files": Path(tempfile.gettempdir())}


def _folders() -> Iterator[Checked]:
    for use, folder in _places().items():
        there = _nearest(folder)
        if _takes_a_file(there):
            yield Checked(f"folder of {use}", "ok", f"{folder} can be written")
        else:
            yield Checked(f"folder of {use}", "fail", f"{folder} cannot be written",
                          f"Check the owner and mode of {there}; nothing is kept meanwhile.")  # fmt: skip


def _nearest(folder: Path) -> Path:
    """The folder, or the nearest one above that is there."""
    return next((one for one in (folder, *folder.parents) if one.exists()), Path("/"))


def _takes_a_file(folder: Path) -> bool:
    try:
        with tempfile.TemporaryFile(dir=folder) as stream:
            stream.write(b"x")
    except OSError:
        return False
    return True


def _room() -> Iterator[Checked]:
    disks: dict[int, tuple[str, Path]] = {}
    for use, folder in _places().items():
        there = _nearest(folder)
        if os.access(there, os.R_OK):
            disks.setdefault(there.stat().st_dev, (use, there))
    for use, folder in disks.values():
        free = shutil.disk_usage(folder).free
        status: Status = "ok" if free >= _LITTLE_BYTES else "warn" if free >= _NOTHING_BYTES else "fail"
        do = "" if status == "ok" else "Make room: large logs are unpacked there, and the history grows."
        yield Checked("disk", status, f"{free / 1e9:.1f} GB are free at {folder} ({use})", do)


def _history() -> Checked:
    from care_core.history.store import SWITCH, History, history_path

    path = history_path()
    if path is None:
        return Checked("history", "warn", "switched off: nothing is remembered", f"Unset {SWITCH} to have it.")
    try:
        count = len(History(path).triages())
    except CareError as err:
        return Checked("history", "fail", err.message, err.hint)
    return Checked("history", "ok", f"{number_of(count, 'run')} in {path}")

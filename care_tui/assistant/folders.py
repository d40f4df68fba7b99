"""Which files an assistant may name: those below the folders that the server was started with, links followed."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from care_core.errors import UsageError
from care_core.folders import entries_in


class Folders:
    """The folders that may be looked into. A path counts by where it really is: no link leads out of them."""

    def __init__(self, folders: Iterable[Path]) -> None:
        """Raises UsageError for what is no folder."""
        self.roots: tuple[Path, ...] = tuple(dict.fromkeys(map(_real, folders)))
        for root in self.roots:
            if not root.is_dir():
                raise UsageError("This is no folder.", hint="Name the folders that hold the logs.", where=str(root))

    def file(self, name: str) -> Path:
        """The file or recording of this name, as it is told by `shown` or from a folder's root on.

        Raises:
            UsageError: nothing of that name is below the folders, or a link leads out of them.
        """
        named = Path(name)
        for path in [named] if named.is_absolute() else [root / named for root in self.roots]:
            if not self._is_inside(path):
                continue
            if path.exists():
                self._check_parts(_real(path))
                return _real(path)
        raise UsageError("No log of that name is in the folders of this server.", hint="'logs' lists them.", where=name)

    def shown(self, path: str | Path) -> str:
        """A path as an assistant is told it: from its folder on, which is its root's name where there are several."""
        real = _real(Path(path))
        root = next((one for one in self.roots if real.is_relative_to(one)), None)
        return real.name if root is None else str(real.relative_to(root)) if real != root else "."

    def holds(self, path: str | Path) -> bool:
        """Whether a path really lies below the folders."""
        return self._is_inside(Path(path))

    def logs(self) -> Sequence[Path]:
        """Every log below the folders, the newest first; what a link leads out to is left out."""
        from care_core.logs.finding import logs_below

        found = {path: _written_s(path) for root in self.roots for path in logs_below(root) if self._is_inside(path)}
        return sorted(found, key=lambda path: -found[path])

    def _is_inside(self, path: Path) -> bool:
        real = _real(path)
        return any(real.is_relative_to(root) for root in self.roots)

    def _check_parts(self, path: Path) -> None:
        """Refuse a recording of which a file, or what is read beside it, is a link out of the folders."""
        for part in _read_with(path):
            if not self._is_inside(part):
                raise UsageError("A link in it leads out of the folders of this server.", where=self.shown(part.parent))


def _read_with(path: Path) -> Iterator[Path]:
    """The files that are read with a log: those in its folder, or those beside it that belong to it."""
    inside = path.is_dir()
    for entry, _ in entries_in(path if inside else path.parent):
        if inside or entry.name == "metadata.yaml" or entry.name.startswith(path.name):
            yield entry


def _real(path: Path) -> Path:
    try:
        return Path(os.path.realpath(path))
    except (OSError, ValueError) as err:  # a name with a zero byte, a circle of links
        raise UsageError("No such file or folder.", hint="Check the path.", where=repr(str(path))) from err


def _written_s(path: Path) -> float:
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0

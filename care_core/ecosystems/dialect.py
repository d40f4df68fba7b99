"""A format of configuration files, as its ecosystem describes it."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import ModuleType

from care_core.records import Record


class Dialect(Record):
    """How an ecosystem writes its configuration."""

    name: str
    suffix: str
    """How names of such files usually end."""
    module: str
    """The module with `read`, `finder` (the values that loaded files give parameters), `write`, `text_of`, `line_of`
    and `commands`."""
    is_written: Callable[[str, str, Path], bool]
    """Whether a file is written so: by its first line that is no comment ("" where there is none), text and path."""
    line: str
    """A pattern for the line of `{key}`: what is before the value, the value, what is behind it."""
    is_yaml: bool = False
    """Whether names are nested and may be loaded into a namespace; else each is unique and stands on a line."""

    @property
    def functions(self) -> ModuleType:
        """The module, imported when it is first asked for: those of YAML take a while."""
        return import_module(self.module)

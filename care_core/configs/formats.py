"""How configuration files are written: each ecosystem has its dialects, told apart by content."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from care_core.ecosystems.ardupilot.dialect import ARDUPILOT_PARAM
from care_core.ecosystems.dialect import Dialect
from care_core.ecosystems.registry import ecosystem_of, ecosystems
from care_core.logs.formats import format_named
from care_core.run import Setting
from care_core.variables import Variable


def format_for(log_format: str, parameters: Iterable[str] = ()) -> Dialect:
    """The dialect of the ecosystem that records such logs; `parameters` are names in the log."""
    recorded = format_named(log_format)
    return ecosystem_of(recorded).dialect(recorded, parameters)


def format_of(text: str, path: Path) -> Dialect:
    """The dialect of a file's text, told from its first line that is no comment, or else from its suffix."""
    lines = (line.rstrip("\r") for line in text.splitlines())
    first = next((line for line in lines if line.strip() and not line.lstrip().startswith("#")), "")
    dialects = (dialect for ecosystem in ecosystems() for dialect in ecosystem.dialects)
    return next((dialect for dialect in dialects if dialect.is_written(first, text, path)), ARDUPILOT_PARAM)


def text_for(format: Dialect, option: Variable, value: float) -> str:
    """An option's value as a file of that format has it."""
    text: str = format.functions.text_of(option, value)
    return text


def write_params(settings: Mapping[str, Setting], format: Dialect, remarks: Mapping[str, str] | None = None) -> str:
    """The settings as a configuration file of that format, with `remarks` by name as comments."""
    text: str = format.functions.write(settings, remarks)
    return text

"""The app's own settings: `settings.yaml` in the platform's configuration folder, or the file of `--settings`."""

from __future__ import annotations

import io
import os
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from care_core.errors import ConfigError, UsageError, nearest
from care_core.files import read_small_text
from care_core.records import Record, field, replace
from care_tui.places import PLACES, at_home

SERVER = "CARE_SERVER"
"""Environment variable that 'care serve' sets for the apps that it starts: its own process."""

SIGNS = "▸✓⣿"
"""What the app draws with where it may."""
COLORS = ("auto", "truecolor", "256", "16", "none")


class Settings(Record):
    """What can be set. A flag of the command line beats the file."""

    theme: str = ""
    """Name of a theme; empty: TEXTUAL_THEME, else the terminal's own colours."""
    color: str = "auto"
    """auto, truecolor, 256, 16 or none."""
    ascii: bool = False
    """Draw without characters outside ASCII."""
    mouse: bool = True
    """Whether the app takes the mouse; without it the terminal's own selection works."""
    fps: int = 0
    """Most frames a second; 0: 15 over SSH, else 60."""
    places: tuple[Path, ...] = PLACES
    """Folders to look for logs in."""
    keys: Mapping[str, str] = field(default_factory=dict)
    """Other keys for actions, by the id that the help screen shows: `step.next: right,n`."""


def settings_path() -> Path:
    """Where the settings of this user are."""
    from platformdirs import user_config_path

    return user_config_path("care") / "settings.yaml"


def load_settings(path: Path | None = None) -> Settings:
    """Read the settings; the defaults when the user has none.

    Raises:
        ConfigError: the named file does not exist, or a line of it cannot be taken, with the key.
    """
    file = path or settings_path()
    if path is None and not file.is_file():
        return Settings()
    data = _read(file)
    if data is None:
        return Settings()
    if not isinstance(data, dict):
        raise ConfigError("The settings are no mapping of names to values.", where=str(file))
    known = set(Settings.__struct_fields__)
    for key in data:
        if key not in known:
            hint = nearest(str(key), known) or f"Known are {', '.join(sorted(known))}."
            raise ConfigError(f"There is no setting '{key}'.", hint=hint, where=str(file))
    try:
        return Settings(**{key: _checked(key, value) for key, value in data.items()})
    except ValueError as err:
        raise ConfigError(f"{err}.", where=str(file)) from None


def _read(file: Path) -> Any:
    from care_core.plain_yaml import PlainYamlError, load

    try:
        return load(read_small_text(file))
    except OSError as err:
        raise ConfigError(f"Cannot read the settings: {err.strerror}.", where=str(file)) from err
    except (PlainYamlError, UnicodeDecodeError) as err:
        raise ConfigError("The settings are no YAML.", hint=str(err).splitlines()[0], where=str(file)) from err


def _checked(key: str, value: Any) -> Any:
    if key in ("ascii", "mouse"):
        _must(isinstance(value, bool), key, "true or false")
    elif key == "fps":
        _must(isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= 60, key, "a number from 0 to 60")
    elif key == "color":
        value = str(value)
        _must(value in COLORS, key, " or ".join(COLORS))
    elif key == "theme":
        _must(isinstance(value, str), key, "the name of a theme")
    elif key == "places":
        _must(isinstance(value, list) and all(isinstance(place, str) for place in value), key, "a list of folders")
        value = tuple(at_home(place) for place in value)
    elif key == "keys":
        mapping = isinstance(value, dict) and all(isinstance(part, str) for pair in value.items() for part in pair)
        _must(mapping, key, "a mapping of action to key")
    return value


def _must(holds: bool, key: str, wanted: str) -> None:
    if not holds:
        raise ValueError(f"'{key}' must be {wanted}")


def with_flags(settings: Settings, *, ascii: bool, mouse: bool, color: str | None, theme: str | None) -> Settings:
    """The settings with what was typed on the command line put over them.

    Raises:
        UsageError: a flag has a value that the setting cannot have.
    """
    if color is not None and color not in COLORS:
        raise UsageError(
            f"There is no way to colour called '{color}'.", hint=f"Allowed: {', '.join(COLORS)}.", where="--color"
        )
    return replace(
        settings,
        ascii=settings.ascii or ascii,
        mouse=settings.mouse and mouse,
        color=color or settings.color,
        theme=theme or settings.theme,
    )


FPS = 500
"""Frames a second at most. A key waits for one or two ticks of the screen's timer, which runs while there is something
to draw: with Textual's 60 they are most of what it waits for. A terminal that is slower is waited for (`link`)."""
SSH_FPS = 30
"""Over SSH, where a terminal that answers is waited for anyway (`link`): for one that does not."""
_TEXTUAL_COLORS = {"truecolor": "truecolor", "256": "256", "16": "standard"}


def takes_only_ascii(encoding: str, term: str) -> bool:
    """Whether the terminal cannot be trusted with more than ASCII: its locale or its name says so, it is not asked.

    Args:
        encoding: what text is sent in, as the locale has it.
        term: the terminal's name. A Linux console and the old hardware terminals have no signs for marks and plots.
    """
    if term == "linux" or re.match(r"vt\d", term):
        return True
    try:
        SIGNS.encode(encoding)
    except (UnicodeEncodeError, LookupError):
        return True
    return False


def prepare_terminal(settings: Settings) -> None:
    """Set what Textual reads from the environment. Call it before Textual is imported; what the user set there wins."""
    # A sign of a log that the terminal's encoding lacks takes one cell, not the six of its escape.
    if isinstance(sys.__stderr__, io.TextIOWrapper):
        sys.__stderr__.reconfigure(errors="replace")
    if settings.color == "none":
        os.environ["NO_COLOR"] = "1"
    elif settings.color != "auto":
        os.environ["TEXTUAL_COLOR_SYSTEM"] = _TEXTUAL_COLORS[settings.color]
    fps = settings.fps or (SSH_FPS if os.environ.get("SSH_CONNECTION") else FPS)
    os.environ.setdefault("TEXTUAL_FPS", str(fps))

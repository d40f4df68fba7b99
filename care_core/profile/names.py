"""What the variables of a profile are called, without checking it: for a shell that completes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from care_core.files import PROFILE_FILE, read_small_text
from care_core.profile.cache import cached_json
from care_core.variables import Role


def variable_names(folder: Path, role: Role) -> list[str]:
    """The names of the variables of this role, in the order of the file; none of a profile that cannot be read."""
    variables = _content(folder).get("variables")
    if not isinstance(variables, Mapping):
        return []
    found = ((name, one.get("role")) for name, one in variables.items() if isinstance(one, Mapping))
    return [str(name) for name, its_role in found if its_role == role.value]


def log_formats(folder: Path) -> list[str]:
    """The formats of the logs that a profile reads."""
    formats = _content(folder).get("logs")
    return [str(one) for one in formats] if isinstance(formats, list) else []


@cache
def _content(folder: Path) -> Mapping[str, Any]:
    """A profile as it was found sound before, else as it is written."""
    try:
        text = read_small_text(folder / PROFILE_FILE)
        kept = cached_json(text)
        content = _from_yaml(text) if kept is None else json.loads(kept)
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, Mapping) else {}


def _from_yaml(text: str) -> Any:
    from care_core.plain_yaml import load  # takes as long as all the rest

    return load(text)

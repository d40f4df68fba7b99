"""Profiles that were found sound, in plain form in the user's cache folder: checking a `profile.yaml` anew takes ten
times as long as reading that.

An entry is named by a hash of the profile's text and of the code that checks it, and begins with the hash of its own
rest, so none is ever out of date or half written; all may be deleted at any time. It holds values, nothing that runs.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import Any

from care_core.profile.schema import EvidenceRule, Schema
from care_core.variables import Events, Extract, OwnLimit, RelativeThreshold, Role, Threshold, Variable

_RECORDS = {
    record.__name__: record
    for record in (Schema, EvidenceRule, Variable, Threshold, RelativeThreshold, OwnLimit, Extract, Events)
}
_CHECKING = (
    "../variables.py",
    "../frozen.py",
    "../plain_yaml.py",
    "../limits.py",
    "../causal/nominal.py",
    "../ecosystems/vehicles/vehicle.py",
    "../logs/base.py",
    "schema.py",
    "schema_file.py",
    "kept.py",
)
"""The code that an entry depends on."""
_MOST = 64
"""Entries that are kept; the ones that were written first go first."""


def kept(text: str) -> Schema | None:
    """The schema of a `profile.yaml` with this text, None where it was not kept."""
    try:
        digest, _, stored = _entry(text).read_text(encoding="utf-8").partition("\n")
        if hashlib.sha256(stored.encode()).hexdigest() != digest:
            return None
        schema = _built(json.loads(stored))
    except (OSError, ValueError, TypeError, KeyError, IndexError):
        return None
    return schema if isinstance(schema, Schema) else None


def keep(text: str, schema: Schema) -> None:
    """Keep a sound profile. A folder that cannot be written to costs time later, and nothing else."""
    from care_core.files import replace_file

    path = _entry(text)
    try:
        stored = json.dumps(_plain(schema), ensure_ascii=False, separators=(",", ":"))
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, f"{hashlib.sha256(stored.encode()).hexdigest()}\n{stored}".encode())
        for old in sorted(path.parent.glob("*.json"), key=lambda entry: -entry.stat().st_mtime)[_MOST:]:
            old.unlink(missing_ok=True)
    except (OSError, ValueError, TypeError):
        return


def _entry(text: str) -> Path:
    from platformdirs import user_cache_path

    name = hashlib.sha256(_code() + text.encode()).hexdigest()
    return user_cache_path("care", appauthor=False) / "profiles" / f"{name}.json"


@cache
def _code() -> bytes:
    """Of every file that says what a sound profile is: another version of the program keeps entries of its own."""
    here = Path(__file__).parent
    return hashlib.sha256(b"".join((here / name).read_bytes() for name in _CHECKING)).digest()


def _plain(value: Any) -> Any:
    """A value as JSON holds it: what is more than a number, a text or a mapping is a list that begins with its kind.

    Raises TypeError for a value that has no such form.
    """
    if value is None or type(value) in (bool, int, float, str):
        return value
    if type(value) in (tuple, list):
        return [type(value).__name__, *map(_plain, value)]
    if isinstance(value, frozenset):
        return ["frozenset", *map(_plain, sorted(value))]
    if isinstance(value, Role):
        return ["Role", value.value]
    if type(value).__name__ in _RECORDS:
        return [type(value).__name__, *(_plain(getattr(value, field.name)) for field in fields(value))]
    if all(type(key) is str for key in value):
        return {key: _plain(part) for key, part in value.items()}
    return ["dict", *([_plain(key), _plain(part)] for key, part in value.items())]


def _built(plain: Any) -> Any:
    """The value that `_plain` was made of."""
    if type(plain) is dict:
        return {key: _built(part) if type(part) in (list, dict) else part for key, part in plain.items()}
    if type(plain) is not list:
        return plain
    kind, *parts = plain
    if kind == "Role":
        return Role(parts[0])
    if kind == "dict":
        return {_built(key): _built(part) for key, part in parts}
    values = [_built(part) if type(part) in (list, dict) else part for part in parts]
    if kind in _RECORDS:
        return _RECORDS[kind](*values)
    return {"tuple": tuple, "list": list, "frozenset": frozenset}[kind](values)

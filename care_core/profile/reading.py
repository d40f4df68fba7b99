"""`profile.yaml` from the disk to its schema: from the cache where it was found sound before, else checked anew."""

from __future__ import annotations

from pathlib import Path

from care_core.errors import ProfileError
from care_core.files import read_small_text
from care_core.profile.cache import cached, store
from care_core.profile.schema import Schema


def read_schema(path: Path) -> Schema:
    """Read and check a `profile.yaml`.

    Raises:
        ProfileError: no such file, not YAML, or a key or value that does not belong, with the nearest known key.
    """
    try:
        text = read_small_text(path)
    except OSError as err:
        raise ProfileError(f"Cannot read the profile: {err.strerror}.", where=str(path)) from err
    except UnicodeDecodeError as err:
        raise ProfileError("Not a profile: it is not text.", where=str(path)) from err
    schema = cached(text)
    if schema is None:
        schema = parse_schema(text, path)
        store(text, schema)
    return schema


def parse_schema(text: str, path: Path) -> Schema:
    """Check the text of a `profile.yaml`; `path` names it in errors. Raises ProfileError as `read_schema`."""
    from care_core.profile.schema_file import parsed  # pydantic, and a second of a slow processor

    return parsed(text, path)

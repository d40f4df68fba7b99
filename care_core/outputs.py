"""What is written where an operator names a file: nothing is replaced but what this program wrote, and never a log.

A file is known as ours by its own mark. What has none by its nature, plain text and parameter files, is signed.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

from care_core.errors import UsageError
from care_core.files import (
    cannot_write,
    is_stream,
    open_regular,
    read_small_bytes,
    refuse_link,
    replace_file,
    write_atomically,
)
from care_core.logs.opening import is_recording
from care_core.text import clean

TEXT_SIGNATURE = "Written by care.\n"
"""The last line of plain text in a file."""
PARAMETERS_SIGNATURE = "# Written by care.\n"
"""The first line of a parameter file: every dialect takes it for a comment."""
BUNDLE_FOLDER = "care-bundle"
PARQUET_KEY = "care.table."
"""Begins a key in the footer of a Parquet table; the kind of its rows ends it."""
FORCE_HINT = "Name another file, or replace it with --force."
REMOVE_HINT = "Name another file, or remove this one first."

_HEAD_BYTES, _TAIL_BYTES = 1 << 14, 1 << 20
_ZIP_HEAD = rb"PK\x03\x04.{26}"
"""How a zip begins, up to the name of its first file (PKWARE APPNOTE 4.3.7)."""
_BEGINNINGS = tuple(
    (kind, re.compile(beginning, re.DOTALL))
    for kind, beginning in (
        ("", rb'\{\s*"schema": "(care\.[\w.]+)/\d'),
        ("", rb"(?:#[^\n]*\n|\s*\n)*schema: (care\.[\w.]+)/\d"),
        ("SARIF", rb'\{\s*"\$schema": "[^"]*sarif[^"]*",.{,400}"name": "care lint"'),
        ("page", rb'<!doctype html>.{,600}<meta name="generator" content="care">'),
        ("Markdown", rb"# Triage of [^\n]*\n\n(?:\*\*[A-Z ]+\*\*|Profile|No profile)"),
        ("Markdown", rb"# Comparison of [^\n]* and [^\n]*\n\n- \*\*A\*\* "),
        ("record", rb"# Verified fixes\n\nOf \d+ fixes "),
        ("card", rb"# Model card: [^\n]*\n"),
        ("model", rb'\{\s*"model_version": \d+,\s*"schema_digest": '),
        ("JUnit", rb'<\?xml [^\n]*\n<testsuites>\s*<testsuite [^\n]* package="care" '),
        ("DOT", rb"// Written by care\.\ndigraph "),
        ("GraphML", rb"<\?xml [^\n]*\n<!-- Written by care\. -->\n<graphml "),
        ("patch", rb"--- as driven\n\+\+\+ suggested\n"),
        ("parameters", re.escape(PARAMETERS_SIGNATURE.encode())),
        ("runs", rb"log,mission,log_format,log_start,log_sha256[,\n]"),
        ("history", rb"at,start,robot,robot_name,log,sha256,mission,profile,"),
        ("failures", rb"log,reason\n"),
        ("bundle", _ZIP_HEAD + BUNDLE_FOLDER.encode() + b"/"),
        ("journal", rb'\{"journal": "care\.ingest/1"'),
    )
)
"""How each kind of file that this program writes begins; a document is of the kind that its schema names."""
_ENDINGS = (
    ("text", re.compile(rb"(?:\A|\n)" + re.escape(TEXT_SIGNATURE.encode()) + rb"\Z")),
    ("", re.compile(rb"\bcare\.table\.(runs|history|fleet)\b.*PAR1\Z", re.DOTALL)),
)


def kind_of(content: bytes) -> str:
    """Which of the kinds of file that this program writes a content is, empty where it is none of them."""
    head, tail = content[:_HEAD_BYTES], content[-_TAIL_BYTES:]
    begun = ((kind, mark.match(head)) for kind, mark in _BEGINNINGS)
    ended = ((kind, mark.search(tail)) for kind, mark in _ENDINGS)
    return next((kind or match[1].decode() for kind, match in (*begun, *ended) if match is not None), "")


def check_replaceable(
    path: Path, content: bytes = b"", *, kind: str = "", force: bool = False, hint: str = FORCE_HINT
) -> None:
    """Refuse a name that may not be written to: a log's, a link's, or of a file that is not of the same kind and ours.

    Args:
        content: what is to be written; before there is any, its `kind` is told.
        force: a file of another kind may be replaced, a log or a link still may not.

    Raises:
        UsageError: why the file is kept.
    """
    if is_stream(path):
        return
    is_like = path.is_file() and _is_like(path, content, kind)
    if not is_like:  # a bundle is an archive too
        refuse_recording(path)
    refuse_link(path)
    if path.is_file() and not is_like and not force:
        raise UsageError("There is a file of another kind, which is kept.", hint=hint, where=str(path))


def _is_like(path: Path, content: bytes, kind: str) -> bool:
    """Whether nothing is lost with a file: it is empty, of the same kind and ours, or holds what is to be written."""
    if not path.stat().st_size:
        return True
    found = kind_of(_ends_of(path))
    return bool(found and found == (kind or kind_of(content))) or bool(content and _holds(path, content))


def _ends_of(path: Path) -> bytes:
    """The beginning and the end of a file. Raises UsageError where it cannot be read."""
    try:
        with open_regular(path) as stream:
            head = stream.read(_HEAD_BYTES)
            left = os.fstat(stream.fileno()).st_size - len(head)
            stream.seek(len(head) + max(0, left - _TAIL_BYTES))
            return head + stream.read(_TAIL_BYTES)
    except OSError as err:
        raise cannot_write(path, err) from err


def _holds(path: Path, content: bytes) -> bool:
    """Whether a file is what is to be written already."""
    try:
        return read_small_bytes(path, len(content)) == content
    except OSError:
        return False


def write_output(
    path: Path, text: str, *, force: bool = False, hint: str = FORCE_HINT, mode: int | None = None
) -> None:
    """Write a text where an operator wants it, whole or not at all; `mode` as of `write_atomically`.

    Raises:
        UsageError: the file that is there is kept (`check_replaceable`), or it cannot be written.
    """
    check_replaceable(path, text.encode("utf-8", "backslashreplace"), force=force, hint=hint)
    write_atomically(path, text, mode)


def write_binary(path: Path, content: bytes, kind: str, *, force: bool = False, hint: str = FORCE_HINT) -> None:
    """Write what is no text, as `write_output`. Raises UsageError."""
    check_replaceable(path, kind=kind, force=force, hint=hint)
    try:
        replace_file(path, content)
    except OSError as err:
        raise cannot_write(path, err) from err


def signed_parameters(text: str, firmware: str = "") -> str:
    """Parameters as a file of this program holds them, with the firmware that they are of, where that is known."""
    about = f"# Firmware: {clean(firmware)}\n" if firmware else ""
    return f"{PARAMETERS_SIGNATURE}{about}{text}" if text else text


def signed(text: str) -> str:
    """A text that has no mark of its own, as a file of this program holds it."""
    if not text:
        return text
    return f"{text}{'' if text.endswith(chr(10)) else chr(10)}{chr(10)}{TEXT_SIGNATURE}"


def refuse_recording(path: Path) -> None:
    """Raise UsageError for a path that holds a log: logs are never written to."""
    if path.is_file() and is_recording(path):
        raise UsageError("This is a log, and logs are never overwritten.", hint="Name another file.", where=str(path))

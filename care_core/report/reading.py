"""A report that care wrote, read back: JSON or YAML, checked key by key."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from care_core.errors import ConfigError, UsageError
from care_core.files import read_small_text
from care_core.history.store import SWITCH, HistoryError
from care_core.records import UnfitError, read
from care_core.report.document import SCHEMA_ID, ProfileEntry, TriageDocument
from care_core.text import clean, shortened


def read_report(path: str | Path) -> TriageDocument:
    """The document of a report as `care triage --json` or `--yaml` wrote it.

    Raises:
        ConfigError: no such file, no report of this program, or a damaged one, with the key.
    """
    path = Path(path)
    data = _load(path)
    if not isinstance(data, Mapping) or data.get("schema") != SCHEMA_ID:
        raise ConfigError(
            f"Not a report: it is no '{SCHEMA_ID}' document.",
            hint="Write one with 'care triage LOG --yaml --out FILE'.",
            where=str(path),
        )
    try:
        return document_of(data)
    except UnfitError as err:
        hint = "Write it again from the log."
        raise ConfigError(f"The report is damaged: {err}.", hint=hint, where=str(path)) from err


def document_of(values: Mapping[str, Any]) -> TriageDocument:
    """The document that plain values hold: of a report, or of what the history remembers.

    A later version of this program may add keys; what this one knows must be sound. Raises UnfitError.
    """
    known = set(TriageDocument.__struct_encode_fields__)
    return read(TriageDocument, {key: value for key, value in values.items() if key in known})


def remembered(document: Mapping[str, Any]) -> TriageDocument:
    """The document of a triage that the history holds. Raises HistoryError for a damaged one."""
    try:
        return document_of(document)
    except UnfitError as err:
        hint = f"Move its file away, or switch the history off with {SWITCH}=off."
        raise HistoryError(f"The history cannot be used: a record in it is damaged, {err}.", hint=hint) from err


def profile_of(report: TriageDocument) -> ProfileEntry:
    """The profile that a report was made with. Raises UsageError where none fitted its log."""
    if report.profile is None:
        raise UsageError(f"No profile fitted the log of this report: {clean('; '.join(report.fit.reasons))}.")
    return report.profile


def _load(path: Path) -> Any:
    from care_core import plain_yaml  # a triage with a history reads what it remembers, which is JSON

    try:
        text = read_small_text(path, encoding="utf-8-sig")
    except OSError as err:
        hint = "Check the path."
        raise ConfigError(f"Cannot read the report: {err.strerror}.", hint=hint, where=str(path)) from err
    except UnicodeDecodeError as err:
        raise ConfigError("Not a report: it is not text.", where=str(path)) from err
    try:
        return _json(text) if text.lstrip().startswith("{") else plain_yaml.load(text)
    except (ValueError, RecursionError) as err:
        if path.suffix.casefold() not in (".yaml", ".yml", ".json"):
            hint = "Give the one in YAML or JSON: 'care triage LOG --out report.yaml' writes it."
            raise ConfigError("A report in this format is for people to read.", hint=hint, where=str(path)) from err
        detail = shortened(" ".join(str(err).split()), 120)
        raise ConfigError(f"The report cannot be read: {detail}.", hint="Write it again.", where=str(path)) from err


def _json(text: str) -> Any:
    from json import loads

    return loads(text)

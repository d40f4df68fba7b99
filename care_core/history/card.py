"""The track record of a profile, written into its model card."""

from __future__ import annotations

from pathlib import Path

from care_core.errors import ProfileError
from care_core.files import write_atomically
from care_core.history.track_record import TrackRecord

CARD = "MODEL_CARD.md"
_TITLE = "## Verified fixes"


def update_card(folder: Path, record: TrackRecord) -> Path:
    """Put the verified outcomes into the profile's model card, in place of those it had. Returns the card.

    Raises:
        ProfileError: the profile has no card.
        UsageError: the card may not be written.
    """
    path = folder / CARD
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as err:
        raise ProfileError(f"Cannot read the model card: {err.strerror}.", where=str(path)) from err
    before, _, rest = text.partition(_TITLE)
    _, found, after = rest.partition("\n## ")
    kept = f"## {after}" if found else ""
    write_atomically(path, f"{before.rstrip()}\n\n{_section(record)}\n{kept}")
    return path


def _section(record: TrackRecord) -> str:
    lines = [
        _TITLE,
        "",
        f"Of {record.count} fixes that were made and verified after the next run, {record.worked} worked; the odds"
        f" promised {record.expected:.1f}.",
        "",
        "| promised | fixes | mean promise | worked |",
        "|---|---|---|---|",
        *(f"| {b.low:.0%} to {b.high:.0%} | {b.count} | {b.promised:.0%} | {b.worked} |" for b in record.bins),
    ]
    return "\n".join(lines) + "\n"

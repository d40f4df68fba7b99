"""What was triaged and verified on this computer: one SQLite file, and what it says about the odds we promise."""

from care_core.history.store import SWITCH, History, HistoryError, Triaged, Verified, history_path
from care_core.history.track_record import Bin, TrackRecord, sparkline, track_record, trends

__all__ = [
    "SWITCH",
    "Bin",
    "History",
    "HistoryError",
    "TrackRecord",
    "Triaged",
    "Verified",
    "history_path",
    "sparkline",
    "track_record",
    "trends",
]

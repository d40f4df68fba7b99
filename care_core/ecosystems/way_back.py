"""How a parameter that keeps a vehicle from arming is put right, by who sets it and for what."""

from __future__ import annotations

from care_core.metadata.causal_map import Role
from care_core.run import shown


def way_back(name: str, role: Role | None, wanted: float | None, does: str = "puts it back") -> str:
    """The way back in words; with the command where a value is wanted."""
    if wanted is not None:
        return f"'param set {name} {shown(wanted)}' {does}"
    return "calibrate again" if role in ("calibration", "written") else "check it first"

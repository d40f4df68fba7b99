"""Copying over SSH: OSC 52 asks the operator's own terminal to take the text, through tmux and screen where needed."""

from __future__ import annotations

import base64
import os
from collections.abc import Mapping

MAX_BYTES = 74_994
"""Longest text whose OSC 52 sequence stays below the 100 000 bytes that terminals are known to accept."""
_SCREEN_CHUNK = 250
"""screen drops device control strings that are longer."""


def fits(text: str) -> bool:
    """Whether terminals can be expected to take a text of this length."""
    return len(text.encode()) <= MAX_BYTES


def osc52(text: str, environ: Mapping[str, str] = os.environ) -> str:
    """The sequence that copies the text, wrapped for the multiplexer that the program runs in."""
    sequence = f"\x1b]52;c;{base64.b64encode(text.encode()).decode()}\x07"
    if environ.get("TMUX"):
        return f"\x1bPtmux;{sequence.replace(chr(27), chr(27) * 2)}\x1b\\"
    if environ.get("TERM", "").startswith("screen"):
        parts = (sequence[i : i + _SCREEN_CHUNK] for i in range(0, len(sequence), _SCREEN_CHUNK))
        return "".join(f"\x1bP{part}\x1b\\" for part in parts)
    return sequence

"""Damage in few words: a log can be broken in thousands of places."""

from __future__ import annotations

from collections.abc import Sequence

from care_core.run import Damage

MAX_LISTED = 10


def summarised(found: Sequence[Damage], what: str) -> tuple[Damage, ...]:
    """The damage place by place, or as one entry "N WHAT" with the first place and the last where there are many.

    The last stays an entry of its own, because it says whether the end of the log is there.
    """
    if len(found) <= MAX_LISTED:
        return tuple(found)
    first, last = found[0], found[-1]
    text = f"{len(found)} {what}, the first: {first.what}"
    return Damage(text, first.byte, first.time_s, first.is_jump), last

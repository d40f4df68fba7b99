"""What the default run takes a sample of: with `CARE_WHOLE` set, as `make sweep` does, it is all."""

from __future__ import annotations

import os
from collections.abc import Iterable
from itertools import islice
from typing import TypeVar

T = TypeVar("T")
WHOLE = bool(os.environ.get("CARE_WHOLE"))


def examples(most: int) -> int:
    """How many examples of what is dear to try are drawn: a third, and all in a whole run."""
    return most if WHOLE else most // 3


def one_in(every: int, items: Iterable[T], first: int = 0) -> list[T]:
    """One of so many items, from the one at `first` on; all in a whole run."""
    return list(items) if WHOLE else list(islice(items, first, None, every))

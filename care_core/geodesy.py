"""The earth: places on it as metres on a plane around one of them, exact to centimetres over a few kilometres, and what
things weigh there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from care_core.numbers import Floats

METRES_PER_DEGREE = 111_319.49
"""Of latitude, and of longitude at the equator (WGS 84)."""
GRAVITY = 9.81
"""m/s^2, within 0.03 anywhere on the ground."""

Coordinate = TypeVar("Coordinate", float, "Floats")
"""Of one place, or of many, shape (n,)."""


def offset_m(home: Sequence[float], lat: Coordinate, lon: Coordinate) -> tuple[Coordinate, Coordinate]:
    """Metres north and east of home, whose latitude and longitude in degrees come first."""
    narrow = math.cos(math.radians(home[0]))
    return (lat - home[0]) * METRES_PER_DEGREE, (lon - home[1]) * METRES_PER_DEGREE * narrow

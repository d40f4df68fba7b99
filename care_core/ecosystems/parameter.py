"""A number that the parameters of a robot say of it, its size say: a context, since no mission is repaired by it."""

from __future__ import annotations

from care_core.ecosystems.measures import Args, Argument, Mission, extractor
from care_core.run import Unavailable, Value


def _are_names(value: object) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(name, str) for name in value)


@extractor(
    "parameter",
    needs={},
    parts=("parameters",),
    unit="that of the parameter",
    args={"names": Argument("list of parameters", _are_names)},
)
def parameter(mission: Mission, args: Args) -> Value:
    """The number that a parameter was driven with, of several the largest."""
    names = args.get("names", ())
    values = [mission.settings[name] for name in names if name in mission.settings]
    numbers = [float(value) for value in values if isinstance(value, (int, float)) and not isinstance(value, bool)]
    if not numbers:
        return Unavailable(f"the log does not hold {' or '.join(names)}", "record the parameters as driven")
    return max(numbers)

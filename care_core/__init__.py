"""Which parameter made a robot's run fail, along which path, and what to change.

    case = care_core.triage("flight.BIN")
    print(case.report())

The names below are the public ones. Each is imported when it is first used, so `import care_core` costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from care_core.application.api import apply, compare, inspect, open_log, triage, verify, what_if
    from care_core.application.case import Case, Request
    from care_core.errors import CareError

__all__ = ["CareError", "Case", "Request", "apply", "compare", "inspect", "open_log", "triage", "verify", "what_if"]

_HOMES = {
    "CareError": "care_core.errors",
    "Case": "care_core.application.case",
    "Request": "care_core.application.case",
}

if not TYPE_CHECKING:  # so that mistyped names are found where types are checked

    def __getattr__(name: str) -> Any:
        if name not in __all__:
            raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
        if name in _HOMES:
            return getattr(import_module(_HOMES[name]), name)
        from care_core.application import api, speaking

        return speaking.speaking_python(getattr(api, name))

    def __dir__() -> list[str]:
        return [*__all__]

"""Docks of Nav2: their types, and where they stand."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.lint.generic import near
from care_core.lint.problems import LintedFile, Problem
from care_core.lint.readers import Readers, numbers
from care_core.lint.scopes import words_of

_UTILS = "utils.hpp of opennav_docking, parseDockParams"
_DATABASE = "dock_database.cpp of opennav_docking, findDockPlugin"
_POSE = 3


def _docks(file: LintedFile, held: Readers) -> Iterator[Problem]:
    for reader in held.of("docking_server"):
        kinds = words_of(reader.values.get("dock_plugins"))
        for dock in (one for one in held.within(reader.scope) if one.is_a("Dock")):
            kind, pose = dock.values.get("type"), dock.values.get("pose")
            if kind is not None and kinds and kind.kind == "str" and kind.value not in kinds:
                text = f"{dock.name()} is of type {kind.value}, which dock_plugins does not name: no robot docks there."
                meant = near(str(kind.value), kinds)
                hint = f"Did you mean {meant}?" if meant else f"They are {', '.join(kinds)}."
                yield file.warning("cannot-work", kind, text, hint, _DATABASE)
            if pose is not None and pose.kind == "list" and (own := numbers(pose)) and len(own) != _POSE:
                text = f"pose of {dock.name()} has {len(own)} numbers: the docking server does not start."
                hint = "Write x, y and the angle."
                yield file.error("cannot-work", pose, text, hint, _UTILS)


RULES = (_docks,)

"""No module of a room may import itself round a circle, by an import in a function neither."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping

import grimp

TO_MEND = frozenset[str]()
"""Rooms that still have a circle."""


def circles(imports: Mapping[str, Iterable[str]]) -> Iterator[list[str]]:
    """Groups of modules that all reach one another."""

    def reached(start: str) -> set[str]:
        found: set[str] = set()
        left = [start]
        while left:
            new = set(imports[left.pop()]) - found
            found |= new
            left += new
        return found

    reach = {module: reached(module) for module in imports}
    told: set[str] = set()
    for module in sorted(imports):
        if module in reach[module] and module not in told:
            group = sorted(other for other in reach[module] if module in reach[other])
            told.update(group)
            yield group


def test_circles_are_found() -> None:
    assert list(circles({"a": ["b"], "b": ["c"], "c": ["b"], "d": ["a"]})) == [["b", "c"]]


def test_no_room_of_the_core_has_an_import_circle() -> None:
    graph = grimp.build_graph("care_core")
    rooms: dict[str, list[str]] = defaultdict(list)
    for module in graph.modules:
        if module.count(".") > 1:
            rooms[module.split(".")[1]].append(module)
    found = {}
    for room, modules in rooms.items():
        inside = {module: graph.find_modules_directly_imported_by(module) & set(modules) for module in modules}
        if told := list(circles(inside)):
            found[room] = told
    assert {room: told for room, told in found.items() if room not in TO_MEND} == {}
    assert set(found) == TO_MEND

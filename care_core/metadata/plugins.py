"""Plugins of Nav2 by the names that load them, from the table beside this module."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from functools import cache
from pathlib import Path

from care_core.metadata.fact import lines_of
from care_core.metadata.navigation import spanned

SOURCE = "the plugin description files of ros-navigation/navigation2, foxy to rolling"
DWB_CRITICS, MPPI_CRITICS = "dwb_core::TrajectoryCritic", "mppi::critics::CriticFunction"
_TABLE = Path(__file__).with_name("nav2_plugins.tsv")
_SEPARATOR = re.compile(r"::|/")


def releases_of(name: str) -> frozenset[str]:
    """The distributions in which a name loads a plugin; empty for one that none of them knows."""
    return _releases().get(name, frozenset())


def is_loaded_in(name: str, distribution: str) -> bool:
    """Whether a distribution loads any plugin of that kind."""
    kinds = {base for base, known, _ in _table() if known == name}
    return any(base in kinds and distribution in releases_of(known) for base, known, _ in _table())


def spellings(name: str) -> Mapping[str, frozenset[str]]:
    """The names of the same class that some distribution knows, whatever separates package and class."""
    parts = _SEPARATOR.split(name)
    return {known: releases for known, releases in _releases().items() if _SEPARATOR.split(known) == parts}


def names() -> Collection[str]:
    """Every name of every distribution."""
    return _releases().keys()


def package_of(name: str) -> str:
    """The package, or namespace, in which a class is."""
    return _SEPARATOR.split(name)[0]


@cache
def packages() -> frozenset[str]:
    """The packages of the plugins that come with Nav2."""
    return frozenset(package_of(name) for name in names())


@cache
def classes(base: str) -> frozenset[str]:
    """The plugins of a kind, in any distribution, without their package."""
    return frozenset(_SEPARATOR.split(name)[-1] for kind, name, _ in _table() if kind == base)


@cache
def _releases() -> Mapping[str, frozenset[str]]:
    return {name: spanned(releases, "ros2") for _, name, releases in _table()}


@cache
def _table() -> tuple[tuple[str, str, str], ...]:
    rows = (line.split("\t") for line in lines_of(_TABLE)[1:])
    return tuple((base, name, releases) for base, name, releases in rows)

"""Rules for the plugins of Nav2: the names that load them by release, and critics of another controller."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from difflib import get_close_matches

from care_core.ecosystems.ros.ros2_yaml import PARAMETERS
from care_core.lint.problems import Entry, LintedFile, Problem, Severity
from care_core.lint.readers import COLLISIONS
from care_core.lint.rules import ROS2_NODES_RENAMED
from care_core.lint.scopes import Keys, class_of, split, words_of
from care_core.metadata import plugins
from care_core.metadata.navigation import DISTRIBUTIONS, spans

_NAMING = ("plugin", "primary_controller")
"""Keys whose value is the name of a plugin."""
_ALIKE = 0.85
_DWB = "DWBLocalPlanner"
_CONTROLLERS = {_DWB: plugins.DWB_CRITICS, "MPPIController": plugins.MPPI_CRITICS}
"""Controllers that weigh trajectories by critics, and of which kind these are."""
_WITHOUT = ("RegulatedPurePursuitController", "GracefulController")
_LOOKING = {_DWB: ("BaseObstacleCritic", "ObstacleFootprintCritic"), "MPPIController": COLLISIONS}
"""Their critics that hold trajectories against the obstacles of the costmap."""
_BLIND = {
    _DWB: "base_obstacle.cpp and obstacle_footprint.cpp alone refuse obstacles; map_grid.cpp leads over them",
    "MPPIController": "cost_critic.cpp and obstacles_critic.cpp alone weigh what a trajectory runs over",
}
_LOADS = {
    "DWBLocalPlanner": "dwb_local_planner.cpp looks for critics in dwb_critics, with Critic added to their name",
    "MPPIController": "critic_manager.cpp looks for critics in mppi::critics alone",
}
_READS = {
    _DWB: "trajectory_critic.hpp of dwb_core: a critic reads its values below the name that the list has for it",
    "MPPIController": "critic_manager.cpp: a critic reads its values below the name that the list has for it",
}


def check(file: LintedFile, distribution: str) -> Iterator[Problem]:
    """What is wrong with the plugins that a ROS 2 file names.

    Args:
        distribution: what the file is for; empty where nobody says so.
    """
    values = {split(entry): entry for entry in file.entries}
    yield from _names(file, _named(values, distribution), distribution)
    yield from _critics(file, values)


def shown(file: LintedFile) -> frozenset[str]:
    """The releases that load every plugin of a file that any release loads; empty where the file names none, or none
    loads all of them."""
    known = _known(_named({split(one): one for one in file.entries}))
    return frozenset.intersection(*known) if known else frozenset()


def _known(named: Iterable[Entry]) -> list[frozenset[str]]:
    """The releases of each plugin that any release loads."""
    return [releases for one in named if (releases := plugins.releases_of(str(one.value)))]


def _usual(known: Iterable[frozenset[str]]) -> frozenset[str]:
    """The releases that load most of these plugins."""
    counts = Counter(release for releases in known for release in releases)
    most = max(counts.values(), default=0)
    return frozenset(release for release, count in counts.items() if count == most)


def _named(values: Mapping[Keys, Entry], distribution: str = "") -> list[Entry]:
    """What names a plugin, without the nodes that the file's release has by another name: it loads nothing of theirs.

    That release is told, or the plugins of the other nodes show it.
    """
    named = {keys: entry for keys, entry in values.items() if PARAMETERS in keys and keys[-1] in _NAMING}
    others = [entry for keys, entry in named.items() if not _since_when_renamed(keys)]
    releases = {distribution} if distribution else _usual(_known(others))
    order = DISTRIBUTIONS["ros2"]
    first = min((order.index(one) for one in releases), default=-1)
    return [
        entry for keys, entry in named.items() if not (since := _since_when_renamed(keys)) or first < order.index(since)
    ]


def _since_when_renamed(keys: Keys) -> str:
    """The release since which the node of a value has another name, empty where it has none."""
    node = keys[keys.index(PARAMETERS) - 1]
    return next((since for old, _, since, _ in ROS2_NODES_RENAMED if old == node), "")


def _names(file: LintedFile, named: list[Entry], distribution: str) -> Iterator[Problem]:
    known: list[tuple[Entry, frozenset[str]]] = []
    for entry in named:
        name = str(entry.value)
        releases = plugins.releases_of(name)
        if not releases:
            yield from _never(file, entry, name)
        elif distribution and distribution not in releases:
            yield _elsewhere(file, entry, name, releases, distribution)
        else:
            known.append((entry, releases))
    if not distribution:
        yield from _beside(file, known)


def _never(file: LintedFile, entry: Entry, name: str) -> Iterator[Problem]:
    """A name that no release has, of a class that there is, or of one that is spelled nearly so."""
    if plugins.package_of(name) not in plugins.packages():
        return
    meant = list(plugins.spellings(name)) or get_close_matches(name, plugins.names(), n=1, cutoff=_ALIKE)
    if meant:
        text = f"No release of Nav2 loads a plugin by the name {name}."
        hint = f"Did you mean {meant[-1]}?"
        yield file.error("plugin-name", entry, text, hint, plugins.SOURCE)


def _elsewhere(file: LintedFile, entry: Entry, name: str, releases: frozenset[str], distribution: str) -> Problem:
    now = next((one for one, held in plugins.spellings(name).items() if distribution in held), "")
    if now:
        text = f"{name} is {now} in {distribution}, which does not know the other spelling."
        return file.error("plugin-name", entry, text, f"Write {now}.", plugins.SOURCE)
    text = f"{name} is a plugin of {spans(releases, 'ros2')}, not of {distribution}"
    is_asked = plugins.is_loaded_in(name, distribution)
    text += "." if is_asked else ", which loads none of its kind."
    severity = Severity.ERROR if is_asked else Severity.WARNING
    hint = "Is the file for this distribution?"
    return file.problem("plugin-name", severity, entry, text, hint, plugins.SOURCE)


def _beside(file: LintedFile, known: list[tuple[Entry, frozenset[str]]]) -> Iterator[Problem]:
    """Names that no one release loads together: those off the releases that load most of them."""
    usual = _usual(releases for _, releases in known)
    for entry, releases in known:
        if releases & usual:
            continue
        name = str(entry.value)
        now = [one for one, held in plugins.spellings(name).items() if held & usual]
        own, other = spans(releases, "ros2"), spans(usual, "ros2")
        text = f"{name} is loaded in {own}, and the other plugins of this file in {other}."
        hint = f"Write {now[0]}." if now else "No release loads all of them."
        others = [one for one, held in known if not held & releases]
        yield file.warning("plugin-name", entry, text, hint, plugins.SOURCE, others)


# Critics


def _critics(file: LintedFile, values: Mapping[Keys, Entry]) -> Iterator[Problem]:
    for keys, entry in values.items():
        if keys[-1] != "plugin" or PARAMETERS not in keys:
            continue
        here = keys[:-1]
        handed = values.get((*here, "primary_controller"))
        owner = class_of(str((handed or entry).value))
        if owner in _CONTROLLERS:
            yield from _listed(file, values, here, owner)
            yield from _blind(file, values, here, owner)
            yield from _unlisted(file, values, here, owner)
        if owner in _CONTROLLERS or owner in _WITHOUT:
            yield from _parts(file, values, here, owner)


def _listed(file: LintedFile, values: Mapping[Keys, Entry], here: Keys, owner: str) -> Iterator[Problem]:
    """Critics of the other controller in the list of those that are to be loaded."""
    entry = values.get((*here, "critics"))
    if entry is None or (*here, "default_critic_namespaces") in values:
        return
    for name in words_of(entry):
        other = _of_other(name, owner)
        if other and (*here, name, "class") not in values:
            text = f"{name} is a critic of {other}, not of {owner}: the controller does not load."
            hint = f"Leave it out, or load {other}."
            yield file.error("plugin-name", entry, text, hint, _LOADS[owner])


def _unlisted(file: LintedFile, values: Mapping[Keys, Entry], here: Keys, owner: str) -> Iterator[Problem]:
    """Parameters of critics that the list does not name, or by another name: once for each critic."""
    entry = values.get((*here, "critics"))
    listed = words_of(entry)
    seen: set[str] = set()
    for keys, value in values.items():
        if not listed or len(keys) < len(here) + 2 or keys[: len(here)] != here:
            continue
        name = keys[len(here)]
        if name in seen or name in listed or not _is_critic(name, _CONTROLLERS[owner]):
            continue
        seen.add(name)
        meant = next((one for one in listed if _plain(one) == _plain(name)), "")
        if meant:
            text = f"{name} is {meant} in the list of critics: nothing reads this part."
            hint = f"Name the part {meant}, as the list does."
            yield file.warning("misplaced-key", value, text, hint, _READS[owner])
        else:
            text = f"Nothing loads {name}: the list of critics does not name it."
            yield file.note("not-loaded", value, text, "Add it to critics, or leave it out.")


def _plain(critic: str) -> str:
    return critic.removesuffix("Critic")


def _blind(file: LintedFile, values: Mapping[Keys, Entry], here: Keys, owner: str) -> Iterator[Problem]:
    """Controllers none of whose critics looks at obstacles. Nothing is said of lists with critics of other packages."""
    entry = values.get((*here, "critics"))
    listed = words_of(entry)
    known = {name: _class_of_critic(values, here, owner, name) for name in listed}
    if entry is None or not listed or not all(known.values()):
        return
    looking = [name for name in listed if known[name] in _LOOKING[owner]]
    off = [one for name in looking if (one := _switched_off(values, here, owner, name)) is not None]
    if len(off) < len(looking):
        return
    text = f"No critic of {owner} looks at obstacles: its trajectories lead through them."
    plain = [name.removesuffix("Critic") if owner == _DWB else name for name in _LOOKING[owner]]
    mend = f"Raise the scale of {looking[0]}." if off and owner == _DWB else f"Switch {looking[0]} on." if off else ""
    hint = mend or f"Add {' or '.join(plain)} to the list."
    at = off[0] if off else entry
    yield file.warning("hinders", at, text, hint, _BLIND[owner], [entry] if off else [])


def _class_of_critic(values: Mapping[Keys, Entry], here: Keys, owner: str, name: str) -> str:
    """The class of a critic that comes with Nav2, empty for another."""
    given = values.get((*here, name, "class"))
    plain = name if given is None or owner != _DWB else class_of(str(given.value))
    full = plain if owner != _DWB or "Critic" in plain else f"{plain}Critic"
    return full if full in plugins.classes(_CONTROLLERS[owner]) else ""


def _switched_off(values: Mapping[Keys, Entry], here: Keys, owner: str, name: str) -> Entry | None:
    """What keeps a critic from counting: a scale of 0 of DWB's, `enabled` of MPPI's."""
    entry = values.get((*here, name, "scale" if owner == _DWB else "enabled"))
    return entry if entry is not None and (entry.number == 0 if owner == _DWB else entry.value == "false") else None


def _parts(file: LintedFile, values: Mapping[Keys, Entry], here: Keys, owner: str) -> Iterator[Problem]:
    """Parameters of critics that the controller does not have, once for each critic."""
    seen: set[str] = set()
    listed = words_of(values.get((*here, "critics")))
    for keys, entry in values.items():
        if len(keys) < len(here) + 2 or keys[: len(here)] != here:
            continue
        name = keys[len(here)]
        other = _of_other(name, owner)
        if other and name not in seen and name not in listed:
            seen.add(name)
            text = f"{name} is a critic of {other}, not of {owner}: nothing reads this part."
            hint = f"Leave it out, or load {other}."
            source = _LOADS.get(owner, f"the sources of {owner} name no critics")
            yield file.warning("misplaced-key", entry, text, hint, source)


def _of_other(name: str, owner: str) -> str:
    """The other controller, where a critic is its alone."""
    if _is_critic(name, _CONTROLLERS.get(owner, "")):
        return ""
    return next((one for one, kind in _CONTROLLERS.items() if one != owner and _is_critic(name, kind)), "")


def _is_critic(name: str, kind: str) -> bool:
    """DWB adds the word Critic to the name of one that lacks it; MPPI does not."""
    full = name if kind != plugins.DWB_CRITICS or "Critic" in name else f"{name}Critic"
    return full in plugins.classes(kind)

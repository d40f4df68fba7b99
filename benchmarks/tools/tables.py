"""Tables of docs/ that hold what the code knows: `make docs` fills them, a test says when one is out of date.

A page holds `<!-- table: NAME -->`, an empty line, the table, an empty line and `<!-- end of table -->`. What stands
between the two lines is what `TABLES[NAME]` makes.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from typer.main import get_command

from care_core.lint.rules import RULES
from care_core.logs.formats import FORMATS
from care_core.metadata.causal_map import meaning_of
from care_core.metadata.screening import flights_of, screened
from care_core.profile.store import load_profile
from care_core.report.formats import FILE_FORMATS
from care_tui.cli import command_line
from care_tui.manual import EXIT_STATUS, first_sentence

PROFILES = Path(__file__).parents[2] / "profiles"
SCREENED = {"arducopter": "copter", "ardurover": "rover", "px4": "px4", "quadplane": "quadplane"}
"""The kind of vehicle of each profile whose vehicles' other parameters were screened."""
MOST_PARTS = 16
_TABLE = re.compile(r"<!-- table: (?P<name>[\w ]+) -->\n.*?<!-- end of table -->", re.DOTALL)


def with_tables(page: str) -> str:
    """A page with its tables as the code has them now. Raises KeyError for a table that nobody makes."""
    return _TABLE.sub(lambda block: _marked(block["name"]), page)


def _marked(name: str) -> str:
    return f"<!-- table: {name} -->\n\n{TABLES[name]()}\n\n<!-- end of table -->"


def table(header: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A table in Markdown."""
    titles = tuple(header)
    return "\n".join(_row(cells) for cells in (titles, ("---",) * len(titles), *rows))


def _row(cells: Iterable[str]) -> str:
    escaped = (cell.replace("|", r"\|") for cell in cells)
    return f"| {' | '.join(escaped)} |"


def commands() -> str:
    """Every command with its arguments and what it does."""
    group = get_command(command_line())
    with group.make_context("care", [], resilient_parsing=True) as context:
        return table(("command", "what it does"), _commands(context, group, "care"))


def _commands(context: Any, group: Any, path: str) -> Iterator[tuple[str, str]]:
    for name in group.list_commands(context):
        command = group.commands[name]
        if command.hidden:
            continue
        with type(context)(command, info_name=name, parent=context) as inner:
            if hasattr(command, "commands"):
                yield from _commands(inner, command, f"{path} {name}")
            else:
                arguments = [word.strip("{}") for word in command.collect_usage_pieces(inner) if word != "[OPTIONS]"]
                yield f"`{' '.join((path, name, *arguments))}`", first_sentence(command.help).rstrip(".")


def exit_codes() -> str:
    """What a script learns from the exit code."""
    return table(("exit code", "means"), EXIT_STATUS)


def log_formats() -> str:
    """The formats of logs, as profiles name them in `logs`."""
    rows = (
        (f"`{format.name}`", format.title, ", ".join(f"`{suffix}`" for suffix in format.suffixes)) for format in FORMATS
    )
    return table(("name", "log", "files"), rows)


def report_formats() -> str:
    """The formats of the report that a file's name can choose."""
    positions = {True: "left out unless `--positions`", False: "kept unless `--no-positions`"}
    rows = ((f"`{'`, `'.join(row.suffixes)}`", row.label, positions[row.is_sent]) for row in FILE_FORMATS)
    return table(("file", "format", "positions"), rows)


def lint_rules() -> str:
    """What `care lint` looks for."""
    return table(("rule", "finds", "known from"), ((f"`{rule.id}`", rule.about, rule.source) for rule in RULES))


def profiles() -> str:
    """The profiles that come with the program, with their skill on runs that were left out of training."""
    header = ("profile", "platform", "runs", "parameters", "AUC", "calibration error")
    return table(header, (_profile(path.parent) for path in sorted(PROFILES.glob("*/profile.yaml"))))


def _profile(folder: Path) -> Iterator[str]:
    profile = load_profile(folder)
    skill = profile.model.skill["all"]
    yield f"[`{folder.name}`](../profiles/{folder.name}/MODEL_CARD.md)"
    yield profile.schema.platform
    yield str(profile.model.training.runs)
    yield str(len(profile.schema.options))
    yield "" if skill.auc is None else f"{skill.auc:.2f}"
    yield f"{skill.calibration_error:.3f}"


def screening() -> str:
    """Which parameters outside the profiles were flown wrong one at a time, by vehicle and by what they belong to."""
    header = (
        "profile",
        "parameters it models",
        "others screened",
        "values flown",
        "of these lost",
        "screened, by part",
    )
    return table(header, (_screened(profile, kind) for profile, kind in SCREENED.items()))


def _screened(profile: str, kind: str) -> Iterator[str]:
    names = screened(kind)
    flights = [flight for name in names for flight in flights_of(name, kind)]
    parts = Counter(meaning.part for name in names if (meaning := meaning_of(name, kind)) is not None)
    yield f"`{profile}`"
    yield str(len(load_profile(PROFILES / profile).schema.options))
    yield str(len(names))
    yield str(len(flights))
    yield str(sum(flight.is_lost for flight in flights))
    rest = parts.most_common()[MOST_PARTS:]
    told = (f"{part} {count}" for part, count in parts.most_common(MOST_PARTS))
    yield f"{', '.join(told)}, {len(rest)} other parts {sum(count for _, count in rest)}"


TABLES: dict[str, Callable[[], str]] = {
    "commands": commands,
    "exit codes": exit_codes,
    "lint rules": lint_rules,
    "log formats": log_formats,
    "profiles": profiles,
    "report formats": report_formats,
    "screening": screening,
}

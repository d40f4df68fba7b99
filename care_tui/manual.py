"""The manual page, made from the help of the commands: `python -m care_tui.manual FILE` writes it."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from typer.main import get_command

from care_tui import __version__
from care_tui.cli import OPEN, command_line

EXIT_STATUS = (
    ("0", "all objectives are within their thresholds; the command did what it was asked"),
    ("1", "a fault was found"),
    ("2", "the command line, a configuration or a profile is wrong"),
    ("3", "no fault was found, but something could not be evaluated"),
    ("4", "a log could not be read"),
    ("130", "interrupted (143: asked to end)"),
)
_ENVIRONMENT = (
    ("CARE_HISTORY", "off, or the file to remember runs in"),
    ("CARE_DEBUG", "1: errors come with their traceback"),
    ("NO_COLOR", "no colours"),
)
_FILES = (
    ("~/.config/care/settings.yaml", "settings of the app: theme, keys, folders of logs"),
    ("~/.config/care/site.yaml", "your own limits"),
    ("~/.local/share/care/history.sqlite3", "runs that were triaged, and fixes that were verified"),
    ("~/.local/share/care/profiles/", "profiles of your own"),
)


def manual_page() -> str:
    """The page of the whole command line, in the macros of man(7)."""
    group = get_command(command_line())
    with group.make_context("care", [], resilient_parsing=True) as context:
        return "\n".join(_page(context)) + "\n"


def _page(context: Any) -> Iterator[str]:
    group = context.command
    yield f'.TH CARE 1 "" "care {__version__}" "User Commands"'
    yield from (".SH NAME", f"care \\- {_roff(first_sentence(group.help).rstrip('.').lower())}")
    yield from (".SH SYNOPSIS", ".B care", "[\\fILOG\\fR] [\\fIOPTION\\fR]...", ".br", ".B care")
    yield "\\fICOMMAND\\fR [\\fIOPTION\\fR]... [\\fIARGUMENT\\fR]..."
    yield from (".SH DESCRIPTION", _roff(group.help))
    yield "Without a command the terminal app is opened on a log, the newest of the usual places if none is named."
    yield from (".SH OPTIONS", "With the app:", *_options(context, group.commands[OPEN]), ".PP", "Alone:")
    yield from _options(context, group)
    yield ".SH COMMANDS"
    yield from _commands(context, group, "care")
    for title, rows in (("EXIT STATUS", EXIT_STATUS), ("ENVIRONMENT", _ENVIRONMENT), ("FILES", _FILES)):
        yield f".SH {title}"
        for name, text in rows:
            yield from (".TP", f".B {_roff(name)}", _roff(text))


def _commands(context: Any, group: Any, path: str) -> Iterator[str]:
    """Every command with its help and options, those in groups too."""
    for name in group.list_commands(context):
        command = group.commands[name]
        if command.hidden:
            continue
        with type(context)(command, info_name=name, parent=context) as inner:
            words = " ".join(_roff(piece) for piece in command.collect_usage_pieces(inner))
            yield f'.SS "{_roff(path)} {_roff(name)} {words}"'
            for number, paragraph in enumerate(re.split(r"\n\s*\n", (command.help or "").strip())):
                yield from ((".PP",) if number else ())
                yield _roff(" ".join(paragraph.split()))
            yield from _options(inner, command)
            if hasattr(command, "commands"):
                yield from _commands(inner, command, f"{path} {name}")


def _options(context: Any, command: Any) -> Iterator[str]:
    for parameter in command.get_params(context):
        record = parameter.get_help_record(context)
        if record is not None and record[1] and "--help" not in parameter.opts:
            yield from (".TP", f".B {_roff(record[0])}", _roff(" ".join(record[1].split())))


def first_sentence(text: str) -> str:
    """What a help says in its first sentence."""
    return re.split(r"(?<=\.)\s", text.strip(), maxsplit=1)[0]


def _roff(text: str) -> str:
    """The text with what roff would act on escaped."""
    text = text.replace("\\", "\\e").replace("-", "\\-").replace('"', "\\(dq")
    return f"\\&{text}" if text.startswith((".", "'")) else text


def main() -> None:
    """Write the page to the file that is named."""
    Path(sys.argv[1]).write_text(manual_page(), encoding="utf-8")


if __name__ == "__main__":
    main()

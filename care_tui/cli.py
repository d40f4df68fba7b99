"""The `care` command. Only what `--help` needs is imported here; each command imports its own work.

Of the families of commands the one that is asked for is imported and built, all where the help or a mistake needs them.

Data goes to stdout and talk to stderr (`console`); exit codes are `care_core.errors.ExitCode`.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from care_core.errors import UsageError, nearest
from care_tui import __version__
from care_tui.console import emit, escape_the_rest, explain

HELP = "Which parameter made the run fail, along which path, and what to change. 'care LOG' opens the terminal app."
OPEN = "open"
"""The hidden command behind `care LOG`."""
FAMILIES: Mapping[str, tuple[str, ...]] = {
    "opening": (OPEN,),
    "serving": ("serve",),
    "assisting": ("mcp",),
    "diagnosing": ("triage", "demo"),
    "comparing": ("compare",),
    "fleet": ("fleet",),
    "bundling": ("bundle",),
    "asking": ("whatif", "verify"),
    "baselining": ("baseline",),
    "configuring": ("diff", "apply", "lint"),
    "past": ("history",),
    "watching": ("watch",),
    "logs": ("inspect", "params", "ingest"),
    "recording": ("record",),
    "collecting": ("collect",),
    "learning": ("train", "update", "evaluate"),
    "doctor": ("doctor",),
    "shell": ("completion", "man"),
    "profiles": ("profiles",),
    "graph": ("graph",),
    "checks": ("checks",),
    "formats": ("schema",),
}
"""Modules of `care_tui.commands` with the commands that each holds, in the order of the help."""


class CareGroup(TyperGroup):
    """Lets `care LOG` stand beside the commands, and turns every error into a sentence and an exit code."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        own = {name for parameter in self.params for name in (*parameter.opts, "--help")}
        return super().parse_args(ctx, args if ctx.resilient_parsing else route(args, self.commands, own))

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """The group's own options, and before them those of `care LOG`, whose command is hidden."""
        opened = self.commands[OPEN]
        taken = [record for param in opened.params if (record := param.get_help_record(ctx)) is not None]
        with formatter.section("Options of 'care [LOG]'"):
            formatter.write_dl([record for record in taken if record[0].startswith("-")])
        super().format_options(ctx, formatter)

    def main(self, *args: Any, **extra: Any) -> Any:
        try:
            return super().main(*args, **extra)
        except Exception as err:
            if _was_interrupted(err):
                raise KeyboardInterrupt from None
            raise SystemExit(int(explain(err))) from None


def _was_interrupted(err: BaseException | None) -> bool:
    """Whether an interruption lies behind an error: Python before 3.12 makes a RuntimeError of one that meets a class
    while it names its attributes, which importing does all the time."""
    return err is not None and (isinstance(err, KeyboardInterrupt) or _was_interrupted(err.__cause__))


def route(args: list[str], commands: Iterable[str], own: Iterable[str]) -> list[str]:
    """The arguments with `open` put first where they name a log instead of a command.

    Raises:
        UsageError: the first word is neither a command nor a path.
    """
    first = args[0] if args else ""
    if first in {*commands} - {OPEN} or first in own:
        return args
    if not first or first.startswith("-") or _is_path(first):
        return [OPEN, *args]
    hint = nearest(first, {*commands} - {OPEN}) or "See 'care --help', or give the path of a log."
    raise UsageError(f"There is no command '{first}'.", hint=hint)


def _is_path(word: str) -> bool:
    return os.sep in word or Path(word).suffix != "" or Path(word).exists()


def command_line(words: Sequence[str] | None = None) -> typer.Typer:
    """`care` with the one family of commands that these words ask for; with all where they name none, or are None."""
    app = typer.Typer(
        cls=CareGroup,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
        help=HELP,
    )
    app.callback()(_care)
    for family in FAMILIES if words is None else _asked(words):
        app.add_typer(import_module(f"care_tui.commands.{family}").app)
    return app


def _asked(words: Sequence[str]) -> Iterable[str]:
    """The family of the command that is named or, for a log or nothing, of the app's; else all."""
    first = words[0] if words else ""
    named = [family for family, commands in FAMILIES.items() if first in commands and first != OPEN]
    return named or (("opening",) if not first or _is_path(first) else FAMILIES)


def main() -> None:
    """Entry point of the console script."""
    # numpy's own threads only wait for each other on matrices as small as these. Read when numpy is first imported.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # No program of ours plugs into pydantic, and looking for one reads what is known of every installed package.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    # Whoever closes a stream wants none of it (cron, `>&-`).
    sys.stdout = sys.stdout or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    sys.stderr = sys.stderr or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    escape_the_rest()
    completes = "_CARE_COMPLETE" in os.environ  # the shell's words are not the command's then
    command_line(None if completes else sys.argv[1:])(prog_name="care")


def _print_version(wanted: bool) -> None:
    if wanted:
        emit(f"care {__version__}\n")
        raise typer.Exit()


def _care(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    pass

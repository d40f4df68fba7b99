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
"""Modules of `care_tui.commands` with the commands that each holds."""
GROUPS: Mapping[str, tuple[str, ...]] = {
    "Answer a failed run": ("triage", "compare", "whatif", "inspect", "bundle", "demo"),
    "Configuration": ("params", "diff", "lint", "apply"),
    "The next run": ("record", "verify", "baseline"),
    "Many logs": ("fleet", "watch", "history"),
    "Profiles, and learning them": (
        "profiles", "graph", "checks", "ingest", "collect", "train", "update", "evaluate",
    ),
    "Around it": ("serve", "mcp", "doctor", "completion", "man", "schema"),
}  # fmt: skip
"""The commands by what one wants, in the order of the help; the hidden one is in none."""
_MISUSE: type[Exception] = typer.BadParameter.__mro__[1]
"""What Typer raises for a command line that it cannot take."""


class CareGroup(TyperGroup):
    """Lets `care LOG` stand beside the commands, and turns every error into a sentence and an exit code."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        own = {*self.get_help_option_names(ctx), *(name for parameter in self.params for name in parameter.opts)}
        if ctx.resilient_parsing:  # a shell completes: nothing is refused, and what stands behind a log is the app's
            is_opened = bool(args) and args[0] not in self.commands and OPEN in self.commands and _is_path(args[0])
            return super().parse_args(ctx, [OPEN, *args] if is_opened else args)
        return super().parse_args(ctx, route(args, self.commands, own))

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        _leave_reading(self)

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except _MISUSE as err:
            raise _in_a_sentence(err) from None

    def list_commands(self, ctx: Any) -> list[str]:
        """The commands that are there, in the order of the help."""
        wanted = [name for names in GROUPS.values() for name in names]
        return [name for name in (*wanted, OPEN) if name in self.commands]

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """The commands by what one wants."""
        width = max(map(len, self.list_commands(ctx)))
        for title, names in GROUPS.items():
            with formatter.section(title):
                room = formatter.width - width - 4  # its indent, and the gap between the columns
                formatter.write_dl(
                    [(name.ljust(width), self.commands[name].get_short_help_str(room)) for name in names]
                )

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """The commands, the options of `care LOG`, whose command is hidden, and the group's own."""
        self.format_commands(ctx, formatter)
        opened = self.commands[OPEN]
        taken = [record for param in opened.params if (record := param.get_help_record(ctx)) is not None]
        with formatter.section("Options of 'care [LOG]'"):
            formatter.write_dl([record for record in taken if record[0].startswith("-")])
        with formatter.section("Options"):
            formatter.write_dl([record for param in self.get_params(ctx) if (record := param.get_help_record(ctx))])

    def main(self, *args: Any, **extra: Any) -> Any:
        try:
            return super().main(*args, **extra)
        except Exception as err:
            if _was_interrupted(err):
                raise KeyboardInterrupt from None
            raise SystemExit(int(explain(err))) from None


def _leave_reading(command: Any) -> None:
    """Have no file refused before the command looks at it: whoever reads one says what is wrong, with the exit code."""
    for parameter in command.params:
        if hasattr(parameter.type, "readable"):
            parameter.type.readable = False
    for inner in getattr(command, "commands", {}).values():
        _leave_reading(inner)


_AS_OPTIONS = 0.75
"""How alike an option has to be to one that is not there: their dashes alone make any two of them alike by half."""


def _in_a_sentence(err: Any) -> UsageError:
    """What is wrong with a command line, as every other error is told; the hidden command of the app is not named."""
    context = err.ctx
    command = context.command_path.removesuffix(f" {OPEN}")
    is_app = context.info_name == OPEN
    params = [*context.command.params, *(context.parent.command.params if is_app else ())]
    unknown, known = getattr(err, "option_name", ""), {"--help", *(name for one in params for name in one.opts)}
    listed = f"'{command} --help' lists what there is."
    if not unknown:
        message = err.format_message()
        return UsageError(message if message.endswith((".", "?")) else f"{message}.", hint=listed)
    long = [name for name in known if len(unknown) == 2 and name.startswith(f"-{unknown}")]
    hint = f"Did you mean '{long[0]}'?" if len(long) == 1 else nearest(unknown, known, alike=_AS_OPTIONS) or listed
    return UsageError(f"There is no option '{unknown}'.", hint=hint)


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
    for family in FAMILIES if words is None else _families_named(words):
        app.add_typer(import_module(f"care_tui.commands.{family}").app)
    return app


def _families_named(words: Sequence[str]) -> Iterable[str]:
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
    words: list[str] | None = sys.argv[1:]
    if "_CARE_COMPLETE" in os.environ:
        words = _typed_words()
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115  # it would stand in the typed line
    command_line(words)(prog_name="care")


def _typed_words() -> list[str] | None:
    """What stands behind `care` where a shell completes; None where the command itself is still being typed."""
    typed = os.environ.get("_TYPER_COMPLETE_ARGS") or os.environ.get("COMP_WORDS", "")
    words = typed.split()[1:]
    return words if len(words) > 1 else None


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

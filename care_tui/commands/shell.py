"""Commands for the shell around `care`: completion, man."""

from __future__ import annotations

from enum import Enum
from typing import Annotated

import typer

from care_tui.console import emit

app = typer.Typer()


class Shell(str, Enum):
    """The shells that are completed in."""

    BASH = "bash"
    ZSH = "zsh"
    FISH = "fish"


@app.command()
def completion(shell: Annotated[Shell, typer.Argument(metavar="bash|zsh|fish", show_default=False)]) -> None:
    """Print what a shell needs to complete commands and names.

    bash: eval "$(care completion bash)" in ~/.bashrc. zsh: care completion zsh > _care in a folder of $fpath.
    fish: care completion fish > ~/.config/fish/completions/care.fish.
    """
    from typer._completion_shared import get_completion_script

    emit(get_completion_script(prog_name="care", complete_var="_CARE_COMPLETE", shell=shell.value) + "\n")


@app.command()
def man() -> None:
    """Print the manual page. It is made from the help; read it with: care man | man -l -"""
    from care_tui.manual import manual_page

    emit(manual_page())

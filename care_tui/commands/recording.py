"""`care record`: what to record, and how."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import Annotated

import typer

from care_core.errors import UsageError
from care_tui.commands.arguments import Force
from care_tui.completing import profile_names
from care_tui.console import check_writable, emit, say

app = typer.Typer()


@app.command()
def record(
    name: Annotated[
        str,
        typer.Argument(
            metavar="PROFILE",
            help="One of 'care profiles', or px4, ardupilot or ros for any robot.",
            autocompletion=profile_names,
        ),
    ],
    run: Annotated[
        bool, typer.Option("--run", help="Run the recorder of ROS 2, with the parameters of all nodes.")
    ] = False,
    topic: Annotated[
        list[str] | None, typer.Option("--topic", metavar="TOPIC", help="Record this topic too; may be repeated.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="The recording, or of a vehicle the file with its log settings.")
    ] = None,
    force: Force = False,
) -> None:
    """Print what to record for a profile. For ROS it is the recorder's command, for a vehicle its log settings."""
    from care_core.application.recording import recording_text, what_to_record
    from care_core.outputs import signed_parameters

    found = what_to_record(name, topic or ())
    if found.stack == "vehicle":
        if run:
            raise UsageError("A vehicle records by itself.", hint="Load the settings with your ground station.")
        if out is not None:
            check_writable(out)
        emit(found.parameter_file if out is None else signed_parameters(found.parameter_file), out, force=force)
        return
    place = out or Path(f"run-{datetime.now():%Y-%m-%d-%H-%M-%S}")
    if not run:
        emit(recording_text(found, place))
        return
    if found.stack == "ros1":
        raise UsageError("Only the recorder of ROS 2 is run.", hint="Leave out --run to have the command printed.")
    from care_core.application.recorder import record as run_recorder

    raise typer.Exit(run_recorder(found, place, say))

"""`care graph`: the causal graph of a profile."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from care_core.application.case import Request
from care_tui.commands.arguments import AsJson, Force, Out, chosen, format_named_by
from care_tui.completing import profile_names
from care_tui.console import Progress, emit, say

app = typer.Typer()


@app.command()
def graph(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="[PROFILE|LOG]",
            help="A profile, or a log: the profile that fits it, with the path of its cause. The newest log if absent.",
            autocompletion=profile_names,
            show_default=False,
        ),
    ] = None,
    json: AsJson = False,
    dot: Annotated[bool, typer.Option("--dot", help="Print DOT, for Graphviz.")] = False,
    graphml: Annotated[bool, typer.Option("--graphml", help="Print GraphML, for networkx, yEd, Gephi.")] = False,
    top: Annotated[int, typer.Option("--top", min=1, help="How many paths of an objective are printed.")] = 5,
    out: Out = None,
    force: Force = False,
) -> None:
    """Show the causal graph of a profile. Of each objective its parents, its strongest paths, and their support."""
    from care_core.application.graphing import FORMATS, graph_of_profile, graph_of_run, is_log
    from care_core.report.graph import graph_text
    from care_tui.commands.opening import newest_named

    format = chosen({"json": json, "dot": dot, "graphml": graphml})
    if format is None:
        format = format_named_by(out, {name: endings for name, (_, endings) in FORMATS.items()})
    if name is None or is_log(name):
        with Progress() as progress:
            document = graph_of_run(Request(Path(name) if name else newest_named()), progress)
        if not document.cause:
            say("No parameter explains this run best, so no path is marked.")
    else:
        document = graph_of_profile(name)
    text = FORMATS[format][0](document) if format else graph_text(document, top)
    emit(text, out, force=force, is_plain=format is None)

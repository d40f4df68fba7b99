"""Commands that learn profiles."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from care_tui.commands.arguments import AsJson
from care_tui.completing import profile_names
from care_tui.console import Progress, emit, say

app = typer.Typer()

Method = Literal["paper", "engine", "all"]


@app.command()
def train(
    runs: Annotated[Path, typer.Argument(metavar="RUNS", help="A table of runs: .csv or .parquet.")],
    schema: Annotated[Path, typer.Option("--schema", help="The profile.yaml that describes its columns.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="The folder of the new profile.")],
    seed: Annotated[int, typer.Option("--seed", help="Seed of every random choice.")] = 0,
    resamples: Annotated[int, typer.Option("--resamples", min=2, help="Bootstrap resamples.")] = 50,
) -> None:
    """Learn a profile from a table of runs."""
    from care_core.application.training import train_profile

    with Progress() as progress:
        train_profile(runs, schema, out, seed=seed, resamples=resamples, progress=progress)
    say(f"wrote {out}")


@app.command()
def update(
    profile: Annotated[
        str,
        typer.Argument(
            metavar="PROFILE", help="The profile to start from: name or folder.", autocompletion=profile_names
        ),
    ],
    runs: Annotated[Path, typer.Argument(metavar="RUNS", help="Runs of the other robot: .csv or .parquet.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="The folder of the new profile.")],
    seed: Annotated[int, typer.Option("--seed", help="Seed of every random choice.")] = 0,
) -> None:
    """Carry a profile over to another robot with a few of its runs."""
    from care_core.application.training import update_profile

    with Progress() as progress:
        outside = update_profile(profile, runs, out, seed=seed, progress=progress)
    for option in outside:
        say(option)
    say(f"wrote {out}")


@app.command()
def evaluate(
    profile: Annotated[str, typer.Argument(metavar="PROFILE", help="Name or folder.", autocompletion=profile_names)],
    faults: Annotated[Path, typer.Option("--faults", help="The folder of the faults and their true causes.")],
    truth: Annotated[
        list[Path] | None, typer.Option("--truth", help="Table of true causes; found beside the faults if absent.")
    ] = None,
    method: Annotated[Method, typer.Option("--method", help="The paper's rule, the engine of triage, or all.")] = "all",
    json: AsJson = False,
) -> None:
    """Compare a profile's causes with the true ones. Accuracy, precision, recall, F1, RMSE, and baselines beside it."""
    from care_core.application.training import evaluate_profile, evaluation_as_json, evaluation_as_text

    evaluation = evaluate_profile(profile, faults, truth or (), method)
    emit(evaluation_as_json(evaluation) if json else evaluation_as_text(evaluation))

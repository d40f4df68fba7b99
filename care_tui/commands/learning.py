"""Commands that learn profiles."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from care_tui.console import Progress, say

app = typer.Typer()


@app.command()
def train(
    runs: Annotated[Path, typer.Argument(metavar="RUNS", help="A table of runs: .csv or .parquet.")],
    schema: Annotated[Path, typer.Option("--schema", help="The profile.yaml that describes its columns.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="The folder of the new profile.")],
    seed: Annotated[int, typer.Option("--seed", help="Seed of every random choice.")] = 0,
    resamples: Annotated[int, typer.Option("--resamples", min=2, help="Bootstrap resamples.")] = 50,
) -> None:
    """Learn a profile from a table of runs."""
    from care_tui.training import train_profile

    with Progress() as progress:
        train_profile(runs, schema, out, seed=seed, resamples=resamples, progress=progress)
    say(f"wrote {out}")

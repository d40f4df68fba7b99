"""What `care collect` does: a campaign is planned or made, and told as a document."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from care_core.collect.campaign import Campaign, default_folder, read_campaign
from care_core.collect.runner import Collected, collect, first_round
from care_core.errors import ExitCode
from care_core.progress import Progress
from care_core.report.collection import CollectDocument, CollectedRun, LeftOutOption, VariedOption
from care_core.report.document import plain_number
from care_core.text import clean, csv_table

if TYPE_CHECKING:
    from care_core.collect.sampling import Planned


def run_campaign(path: Path, out: Path | None, *, retry_failed: bool, progress: Progress) -> Collected:
    """Make what is left of a campaign. `out` is its folder; one beside it, of its name, where it is None.

    Raises:
        CareError: the campaign is unsound, or its folder cannot be used.
        KeyboardInterrupt: what there is was kept.
    """
    return collect(read_campaign(path), out or default_folder(path), retry_failed=retry_failed, progress=progress)


def plan_table(path: Path) -> tuple[Campaign, str]:
    """A campaign and its plan as CSV (run, seed, the run it repeats, each option); nothing is run. Raises CareError."""
    campaign = read_campaign(path)
    names = [axis.name for axis in campaign.space.axes]
    rows = (
        (run.number, run.seed, run.repeats, *(plain_number(float(f"{run.config[name]:.7g}")) for name in names))
        for run in first_round(campaign)
    )
    return campaign, csv_table([("run", "seed", "repeats", *names), *rows])


def document_of(found: Collected) -> CollectDocument:
    """The campaign as it stands."""
    campaign, space = found.campaign, found.campaign.space
    failed = len(found.failed)
    return CollectDocument(
        campaign=clean(str(campaign.path)),
        profile=clean(campaign.schema.name),
        sampling=campaign.sampling,
        seed=campaign.seed,
        planned=campaign.runs if campaign.sampling == "adaptive" else len(found.planned),
        done=len(found.done) - failed,
        failed=failed,
        resumed=found.resumed,
        stopped=clean(found.stopped),
        table=clean(str(found.table)) if found.rows else None,
        missions=len(found.rows),
        missed=found.missed,
        options=[
            VariedOption(option=a.name, low=a.low, high=a.high, reference=space.reference[a.name]) for a in space.axes
        ],
        left_out=[LeftOutOption(option=name, reason=reason) for name, reason in space.left_out],
        limits=[limit.text for limit in space.limits],
        runs=[_run(found, run) for _, run in sorted(found.planned.items())],
    )


def _run(found: Collected, run: Planned) -> CollectedRun:
    done = found.done.get(run.number)
    return CollectedRun(
        run=run.number,
        repeats=run.repeats,
        status="planned" if done is None else "failed" if done.failure else "done",
        attempts=0 if done is None else done.attempts,
        time_s=0.0 if done is None else done.time_s,
        logs=[] if done is None else [clean(log) for log in done.logs],
        missions=0 if done is None else len(done.rows),
        reason="" if done is None else clean(done.failure),
        unread=[] if done is None else [clean(reason) for reason in done.unread],
        ignored=[] if done is None else list(done.ignored),
    )


def exit_code(found: Collected) -> ExitCode:
    """0 every run has a mission, 3 some have none, 4 none has."""
    if not found.rows:
        return ExitCode.UNREADABLE
    return ExitCode.NOT_EVALUATED if found.failed or found.stopped else ExitCode.OK

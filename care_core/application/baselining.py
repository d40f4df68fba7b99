"""What `care baseline` does: logs of good runs become limits, and the limits a section of the site file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from care_core import plain_yaml
from care_core.application.case import fitting, opened
from care_core.errors import CareError, ConfigError, LogError
from care_core.files import read_small_text
from care_core.profile.site import load_site
from care_core.progress import Progress
from care_core.records import replace
from care_core.text import none_of_logs

if TYPE_CHECKING:
    from care_core.diagnose.baseline import Baseline, Proposal, Refused
    from care_core.diagnose.judging import Judged
    from care_core.logs.base import Log
    from care_core.profile.store import Profile
    from care_core.run import ProfileChoice


def baseline(places: Sequence[Path], profile: str | None, progress: Progress) -> Baseline:
    """Limits from every good run in these logs and folders of logs.

    The first log that a profile fits says which one; logs that it does not fit are refused.

    Raises:
        LogError: none of the logs can be read.
        CareError: a place does not exist, or no profile fits any of the logs.
    """
    from care_core.diagnose.baseline import Baseline, Refused, differing, missions, propose
    from care_core.logs.finding import find_logs

    paths = find_logs(places)
    refused: list[Refused] = []
    errors: list[CareError] = []
    runs: list[Judged] = []
    chosen: tuple[Profile, ProfileChoice] | None = None
    seen: dict[str, Path] = {}
    for number, path in enumerate(paths):
        progress(f"reading {path.name}", number / len(paths))
        try:
            with opened(path) as (log, sha256):
                if sha256() in seen:
                    refused.append(Refused(path, None, f"the same log as {seen[sha256()].name}"))
                    continue
                fit = fitting(log, profile if chosen is None else str(chosen[0].path))
                good, bad = _runs_of(log, fit[0])
                recording = next((one.run.log.identity for one in good), sha256())
                if recording in seen:
                    refused.append(Refused(path, None, f"the same recording as {seen[recording].name}"))
                    continue
        except CareError as err:
            errors.append(err)
            refused.append(Refused(path, None, err.message.rstrip(".")))
            continue
        seen |= {sha256(): path, recording: path}
        chosen = chosen or fit
        runs += good
        refused += [replace(one, log=path) for one in bad]
    if chosen is None:
        raise _none_read(errors)
    found = propose(runs, chosen[0]) if runs else ()
    return Baseline(
        chosen[1], len(paths), tuple(runs), tuple(refused), found, missions(runs, chosen[0].schema), differing(runs)
    )


def _runs_of(log: Log, profile: Profile) -> tuple[list[Judged], list[Refused]]:
    """The good runs of a log, and the others with their reason. Raises CareError."""
    from care_core.diagnose.baseline import Refused, for_any_mission, refusal
    from care_core.diagnose.judging import judge
    from care_core.ecosystems.examine import examine
    from care_core.ecosystems.registry import run_model
    from care_core.extract.read import read_runs, reading_plan

    schema, model = for_any_mission(profile.schema), run_model(log)
    model.expect(reading_plan(schema))
    health = examine(model)
    good, bad = [], []
    for run in read_runs(model, schema):
        judged = judge(run, schema, profile.model)
        reason = refusal(judged, health)
        if reason:
            bad.append(Refused(log.path, run.mission.index if run.mission.count > 1 else None, reason))
        else:
            good.append(judged)
    return good, bad


def _none_read(errors: Sequence[CareError]) -> CareError:
    if len(errors) == 1 or not all(isinstance(err, LogError) for err in errors):
        return next((err for err in errors if not isinstance(err, LogError)), errors[0])
    return LogError(f"{none_of_logs(len(errors))} could be read.", hint="Look at one with 'care inspect'.")


_NEW_SITE = "# Limits of this site, read by 'care triage' and the app. Change what you know better.\n"


def site_text(found: Baseline, file: Path) -> str:
    """The site file with the limits of this profile put in; those of other profiles, and remarks, stay as they are.

    Raises:
        ConfigError: the file that is there is no site file.
    """
    if file.is_file() and file.stat().st_size:
        load_site(file)
        text = read_small_text(file)
    else:
        from care_core.profile.site_file import SITE_SCHEMA

        text = f"{_NEW_SITE}schema: {SITE_SCHEMA}\nlimits:\n"
    data = plain_yaml.editable(text)
    data["limits"] = data["limits"] or {}
    proposed = {p.objective.name: _entry(p) for p in found.proposals if p.limit is not None}
    if not proposed:
        raise ConfigError("There is no limit to write.", hint="See why above.", where=str(file))
    data["limits"][found.choice.name] = proposed
    return plain_yaml.written(data)


def _entry(proposal: Proposal) -> dict[str, Any]:
    entry: dict[str, Any] = {"op": proposal.op, "ratio" if proposal.relative else "value": proposal.limit}
    bound = proposal.objective.relative
    if bound is not None and bound.at_least is not None:
        entry["at_least"] = bound.at_least
    if proposal.mission:
        entry["mission"] = dict(proposal.mission)
    return entry

"""What `care inspect` says of a log, as text and as JSON."""

from __future__ import annotations

from dataclasses import dataclass
from json import dumps

from care_core.errors import CareError
from care_core.extract.read import read_runs
from care_core.logs.base import Log
from care_core.profile.select import Fit, measure_fit
from care_core.profile.store import available_profiles, load_profile
from care_core.run import MissionInfo
from care_core.text import clean


@dataclass(frozen=True, slots=True)
class Inspection:
    """A log, the profiles that fit it (best first), and the missions that the best of them finds."""

    log: Log
    fits: tuple[Fit, ...]
    missions: tuple[MissionInfo, ...]


def inspect_log(log: Log) -> Inspection:
    """Look into a log without judging it."""
    fits = [fit for fit in (measure_fit(log, load_profile(path).schema) for path in available_profiles()) if fit.found]
    fits.sort(key=lambda fit: (-fit.found, -fit.names, fit.schema.name))
    missions: tuple[MissionInfo, ...] = ()
    if fits:
        try:
            missions = tuple(run.mission for run in read_runs(log, fits[0].schema))
        except CareError:
            missions = ()  # a log without missions is still worth looking into
    return Inspection(log, tuple(fits), missions)


def as_json(inspection: Inspection) -> str:
    """One object."""
    log = inspection.log
    data = {
        "path": str(log.path),
        "format": log.format.value,
        "start": log.start,
        "duration_s": log.duration_s,
        "facts": {name: clean(text) for name, text in log.facts.items()},
        "damage": [{"what": clean(damage.what), "byte": damage.byte, "time_s": damage.time_s} for damage in log.damage],
        "channels": [
            {
                "name": clean(channel.name),
                "type": clean(channel.type),
                "count": channel.count,
                "rate_hz": channel.rate_hz,
            }
            for channel in log.channels()
        ],
        "parameters": len(log.settings()),
        "missions": [
            {
                "index": mission.index,
                "start_s": mission.start_s,
                "end_s": mission.end_s,
                "ended": mission.ended,
                "fits": mission.fits,
                "mismatch": mission.mismatch or None,
            }
            for mission in inspection.missions
        ],
        "profiles": [
            {"name": fit.schema.name, "options": fit.options, "sources": fit.sources} for fit in inspection.fits
        ],
    }
    return dumps(data, indent=2, allow_nan=False) + "\n"


def as_text(inspection: Inspection) -> str:
    """Lines for a terminal."""
    log = inspection.log
    lines = [
        f"Log         {clean(str(log.path))}",
        f"Format      {log.format.value}",
        f"Start       {log.start or 'not known (no wall clock)'}",
        f"Duration    {log.duration_s:.1f} s",
        *(f"{name.capitalize():<11} {clean(text)}" for name, text in log.facts.items()),
        f"Parameters  {len(log.settings())}",
        *(f"Damage      {clean(damage.what)}{_at(damage.time_s)}" for damage in log.damage),
        *(f"Mission {mission.index:<3} {_mission(mission)}" for mission in inspection.missions),
        *(f"Profile     {fit.schema.name}: {fit}" for fit in inspection.fits),
    ]
    if not inspection.fits:
        lines.append("Profile     none fits")
    elif not inspection.missions:
        lines.append("Mission     none found")
    channels = sorted(log.channels(), key=lambda channel: channel.name)
    width = max((len(channel.name) for channel in channels), default=0)
    lines += ["", f"{'Channel':<{width}}  {'Count':>8}  {'Hz':>8}  Type"]
    for channel in channels:
        rate = "" if channel.rate_hz is None else f"{channel.rate_hz:.1f}"
        lines.append(f"{clean(channel.name):<{width}}  {channel.count:>8}  {rate:>8}  {clean(channel.type)}")
    return "\n".join(lines) + "\n"


def _at(time_s: float | None) -> str:
    return "" if time_s is None else f" at {time_s:.1f} s"


def _mission(mission: MissionInfo) -> str:
    end = "" if mission.ended else ", the log ends before it does"
    return f"{mission.start_s:.1f} to {mission.end_s:.1f} s{end}{f', {mission.mismatch}' if mission.mismatch else ''}"

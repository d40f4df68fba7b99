"""A small robot whose every mechanism is known, so that a fault can be planted and a fix be tried for real.

min_sats -> armed -> success              refuses to arm where more satellites are asked for than there are
radius, speed -> tracking_error -> success
speed -> mean_speed -> time
planner -> replans -> time
reserve -> hold_s -> time                 `reserve` is a safety option: less of it is faster, and never suggested
speed, accel -> sag -> energy
inert, filter                             move nothing
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from care_core.causal.counterfactual import CounterfactualQuery
from care_core.learn.train import TrainSettings
from care_core.profile.schema import Schema
from care_core.profile.store import Profile
from care_core.records import replace
from care_core.run import LogInfo, MissionInfo, Run, Unavailable, Value
from care_core.variables import Role, Threshold, Variable

OPTIONS = (
    Variable("speed", Role.OPTION, unit="m/s", range=(1.0, 10.0), default=5.0),
    Variable("accel", Role.OPTION, unit="m/s^2", range=(0.5, 4.0), default=1.5, reboot_required=True),
    Variable("radius", Role.OPTION, unit="m", range=(0.1, 1.0), default=0.5, parameters=("/a/radius", "/b/radius")),
    Variable("reserve", Role.OPTION, "int", unit="%", range=(10, 60), default=20, safety=True),
    Variable("min_sats", Role.OPTION, "int", range=(4, 14), default=6),
    Variable("planner", Role.OPTION, "enum", default=1, labels=((0, "straight"), (1, "smooth"), (2, "greedy"))),
    Variable("filter", Role.OPTION, "bool", default=1),
    Variable("inert", Role.OPTION, range=(0.0, 1.0), default=0.5),
)
METRICS = (
    Variable("armed", Role.METRIC, "bool"),
    Variable("mean_speed", Role.METRIC, unit="m/s"),
    Variable("tracking_error", Role.METRIC, unit="m"),
    Variable("replans", Role.METRIC),
    Variable("hold_s", Role.METRIC, unit="s"),
    Variable("sag", Role.METRIC, unit="V"),
)
SUCCESS = Variable("success", Role.OBJECTIVE, "bool", kind="functional", threshold=Threshold(">=", 1))
TIME = Variable("time", Role.OBJECTIVE, unit="s", kind="non-functional", threshold=Threshold("<=", 175))
ENERGY = Variable("energy", Role.OBJECTIVE, unit="Wh", kind="non-functional", threshold=Threshold("<=", 20))
VARIABLES = (*OPTIONS, *METRICS, SUCCESS, TIME, ENERGY)
SCHEMA = Schema(
    name="planted",
    version="1",
    platform="Simulated robot",
    doc="",
    match={},
    logs=(),
    observational=False,
    mission={},
    evidence=(),
    variables={v.name: v for v in VARIABLES},
    digest="d" * 64,
)
BOUNDS = {v.name: v.threshold for v in SCHEMA.objectives if v.threshold is not None}
DEFAULTS = {v.name: float(v.default or 0.0) for v in OPTIONS}
NOISE = ("sats", "speed", "error", "replans", "hold", "sag", "time", "energy")
CALM = dict.fromkeys(NOISE, 0.0)
MISSED = float("nan")
SETTINGS = TrainSettings(resamples=3, n_jobs=1, origin="simulated")


def fly(config: Mapping[str, float], noise: Mapping[str, float]) -> dict[str, float]:
    """Metrics and objectives of one mission; NaN for what a refused or failed mission does not have."""
    after = [v.name for v in VARIABLES if v.role in (Role.METRIC, Role.OBJECTIVE)]
    out = dict.fromkeys(after, MISSED)
    out["armed"] = float(config["min_sats"] <= 10 + noise["sats"])
    out["success"] = 0.0
    if not out["armed"]:
        return out
    out["mean_speed"] = 0.9 * config["speed"] ** 0.9 * np.exp(0.04 * noise["speed"])
    out["tracking_error"] = 0.2 + 4 * (config["radius"] - 0.5) ** 2 + 0.03 * config["speed"] + 0.05 * noise["error"]
    out["replans"] = max(0.0, {0: 3.0, 1: 2.0, 2: 9.0}[int(config["planner"])] + 0.7 * noise["replans"])
    out["hold_s"] = 0.9 * config["reserve"] + 1.5 * noise["hold"]
    out["sag"] = 0.3 * config["accel"] + 0.06 * config["speed"] + 0.05 * noise["sag"]
    if out["tracking_error"] > 0.75:
        return out
    out["success"] = 1.0
    out["time"] = 40 + 250 / out["mean_speed"] + 6 * out["replans"] + 1.2 * out["hold_s"] + 2 * noise["time"]
    out["energy"] = 6 + 13 * out["sag"] + 0.4 * noise["energy"]
    return out


def draw_noise(rng: np.random.Generator) -> dict[str, float]:
    return {name: float(rng.normal()) for name in NOISE}


def draw_config(rng: np.random.Generator) -> dict[str, float]:
    """Half of the options at their default, the others anywhere in their range."""
    config = {}
    for option in OPTIONS:
        if rng.random() < 0.5:
            config[option.name] = DEFAULTS[option.name]
        elif option.labels:
            config[option.name] = float(rng.choice([code for code, _ in option.labels]))
        else:
            low, high = option.range or (0.0, 1.0)
            config[option.name] = option.snap(float(rng.uniform(low, high)))
    return config


def fly_many(n: int, seed: int = 0) -> pd.DataFrame:
    """A runs table, one row a mission, options drawn at random."""
    rng = np.random.default_rng(seed)
    configs = [draw_config(rng) for _ in range(n)]
    table = pd.DataFrame([{**config, **fly(config, draw_noise(rng))} for config in configs])
    runs: pd.DataFrame = table[[v.name for v in VARIABLES]].astype(float)
    return runs


def run_of(config: Mapping[str, float], outcome: Mapping[str, float]) -> Run:
    """The run as an extractor would hand it over: NaN becomes `Unavailable`."""
    gone = Unavailable("the mission ended before")
    known: dict[str, Value] = {name: gone if np.isnan(value) else value for name, value in outcome.items()}
    return Run(
        config=dict(config),
        context={},
        metrics={v.name: known[v.name] for v in METRICS},
        objectives={v.name: known[v.name] for v in (SUCCESS, TIME, ENERGY)},
        settings={},
        log=LogInfo("planted.bin", "dataflash-bin", None, 200.0, "0" * 64),
        mission=MissionInfo(1, 1, 0.0, 200.0, ended=True, fits=True),
    )


def planted_run(noise: Mapping[str, float] = CALM, /, **options: float) -> Run:
    """A run with these options off their default."""
    config = {**DEFAULTS, **options}
    return run_of(config, fly(config, noise))


def query_of(
    profile: Profile, run: Run, observed: Mapping[str, object] | None = None, bounds: Mapping[str, Threshold] = BOUNDS
) -> CounterfactualQuery:
    """A run ready to be asked, held against the defaults; what it met is read off unless `observed` is given."""
    seen = {**run.metrics, **run.objectives} if observed is None else observed
    return CounterfactualQuery(profile.model, run.config, seen, bounds, reference=DEFAULTS, variables=SCHEMA.variables)


def planted_query(profile: Profile, /, **options: float) -> CounterfactualQuery:
    """The world of a run with these options off their default."""
    return query_of(profile, planted_run(**options))


def with_variable(schema: Schema, variable: Variable) -> Schema:
    """The schema with one variable declared otherwise."""
    return replace(schema, variables={**schema.variables, variable.name: variable})

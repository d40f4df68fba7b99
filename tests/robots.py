"""Simulated robots as awkward as real ones, with everything known: the graph, and what any intervention would do.

Options are continuous or codes; metrics are continuous, heavy-tailed, counts or yes-or-no; effects bend, have an
optimum inside or need two options at once; a context confounds; some missions are refused and have no metrics. Options
are set at random, or by operators who look at the context, or at something that no column holds.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np
import pandas as pd

from care_core.causal.graph import CausalGraph, Edge
from care_core.numbers import Floats
from care_core.profile.schema import Schema
from care_core.records import Record, replace
from care_core.variables import Role, Threshold, Variable

Shape = Literal["line", "bend", "bump", "step"]
Chosen = Literal["at random", "by context", "by something hidden"]
METRIC_KINDS = ("float", "heavy", "count", "bool")
SHAPES: tuple[Shape, ...] = ("line", "bend", "bump", "step")
TIME_LIMIT = 1.0


class Law(Record):
    """How a cause on its scale (about -1.5 to 1.5) moves its effect."""

    shape: Shape
    strength: float

    def __call__(self, cause: Floats) -> Floats:
        moved = {
            "line": cause,
            "bend": cause + 0.4 * np.tanh(2 * cause),
            "bump": 1.2 * (cause**2 - 1),
            "step": 1.1 * np.sign(cause - 0.4),
        }[self.shape]
        return np.asarray(self.strength * moved)


class Robot(Record):
    """One robot. `drive` flies it; `do` sets options whatever the operators would have chosen."""

    schema: Schema
    graph: CausalGraph
    kinds: Mapping[str, str]
    laws: Mapping[Edge, Law]
    together: tuple[tuple[str, str, str], ...]
    """(option, option, metric): the metric moves only where both options are high."""
    chosen: Chosen = "at random"
    swayed: tuple[str, ...] = ()
    """Options that operators choose by the context or the hidden cause, and the metric that it moves, last."""

    def drive(
        self, n: int, rng: np.random.Generator, do: Mapping[str, float] | None = None, wind_met: float | None = None
    ) -> pd.DataFrame:
        """A runs table of n missions; NaN for what a refused or failed one does not have."""
        weather = rng.choice([-1.0, 1.0], n)
        wind = weather + 0.4 * rng.normal(size=n) if wind_met is None else np.full(n, wind_met)
        columns: dict[str, Floats] = {}
        scores: dict[str, Floats] = {}
        for variable in self.schema.options:
            columns[variable.name] = self._option(variable, wind, weather, rng)
            if do is not None and variable.name in do:
                columns[variable.name] = np.full(n, do[variable.name])
            scores[variable.name] = 3 * (columns[variable.name] / (2 if variable.labels else 1) - 0.5)
        for context in self.schema.contexts:
            columns[context.name] = scores[context.name] = wind
        hidden = {pair: rng.choice([-1.0, 1.0], n) for pair in sorted(self.graph.bidirected)}
        for name in self.graph.topological_order():
            if name not in columns:
                z = 0.5 * rng.standard_t(4, n) if self.kinds[name] == "heavy" else 0.5 * rng.normal(size=n)
                z += sum((self.laws[parent, name](scores[parent]) for parent in self._driven_by(name)), np.zeros(n))
                for a, b, metric in self.together:
                    if metric == name:
                        z += 1.5 * ((scores[a] > 0.3) & (scores[b] > 0.3))
                for pair, coin in hidden.items():
                    if name in pair and not set(pair) & set(self.swayed[:-1]):
                        z += 0.9 * coin
                if self.chosen == "by something hidden" and self.swayed and name == self.swayed[-1]:
                    z += 1.2 * weather
                columns[name], scores[name] = _measured(self.kinds[name], z, rng)
        return self._gone_where_refused(columns)

    def _driven_by(self, name: str) -> tuple[str, ...]:
        return tuple(parent for parent in self.graph.parents(name) if (parent, name) in self.laws)

    def _option(self, variable: Variable, wind: Floats, weather: Floats, rng: np.random.Generator) -> Floats:
        n = len(wind)
        if variable.labels:
            return rng.integers(0, 3, n).astype(float)
        if variable.name in self.swayed[:-1] and self.chosen != "at random":
            met = wind if self.chosen == "by context" else weather
            return np.clip(0.5 - 0.22 * met + 0.12 * rng.normal(size=n), 0.0, 1.0)
        return rng.uniform(0, 1, n)

    def _gone_where_refused(self, columns: dict[str, Floats]) -> pd.DataFrame:
        frame: pd.DataFrame = pd.DataFrame({name: columns[name] for name in self.schema.variables})
        if "armed" in frame:
            refused = frame["armed"] == 0
            flight = [m.name for m in self.schema.metrics if m.name != "armed"]
            frame.loc[refused, flight] = np.nan
            frame.loc[refused, "success"] = 0.0
            frame.loc[frame["success"] == 0, "time"] = np.nan
        return frame


def _measured(kind: str, z: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """What is recorded of a latent value, and what its effects feel of it."""
    if kind == "count":
        count = rng.poisson(np.exp(np.clip(0.8 * z + 1.0, None, 6.0))).astype(float)
        return count, (np.log1p(count) - 1.3) / 0.7
    if kind == "bool":
        return (z > 0.5).astype(float), np.where(z > 0.5, 1.5, -0.5)
    if kind == "armed":
        return (z > -3).astype(float), np.zeros_like(z)
    if kind == "success":
        return (z > -1.8).astype(float), z
    return (np.sinh(1.2 * z) if kind == "heavy" else z), np.clip(z, -3, 3)


def random_robot(
    rng: np.random.Generator,
    *,
    options: int = 8,
    inert: int = 8,
    metrics: int = 6,
    hidden: int = 1,
    refusals: bool = True,
    chosen: Chosen = "at random",
) -> Robot:
    """Draws a robot: every option moves one or two metrics, metrics move later metrics, two metrics each objective.

    With `chosen` not at random, the first three continuous options are chosen by the wind, which also moves the metric
    that the first of them moves: measured (a context) or not.
    """
    names = [f"option_{i}" for i in range(options)]
    stages = ["m_0"] if not refusals else ["armed", "m_0"]
    ms = [*stages, *(f"m_{i}" for i in range(1, metrics))]
    flight = ms[ms.index("m_0") :]
    kinds = {m: METRIC_KINDS[i % 4] for i, m in enumerate(flight)}
    kinds |= {"armed": "armed", "success": "success", "time": "float"}
    laws: dict[Edge, Law] = {}

    def law(shapes: tuple[Shape, ...] = SHAPES) -> Law:
        return Law(shapes[int(rng.integers(len(shapes)))], float(rng.choice([-1, 1]) * rng.uniform(0.5, 0.9)))

    for i, name in enumerate(names):
        second = flight[int(rng.integers(metrics))] if rng.random() < 0.4 else flight[i % metrics]
        for m in dict.fromkeys((flight[i % metrics], second)):
            laws[name, m] = law()
    for j, m in enumerate(flight):
        laws |= {(before, m): law(("line", "bend")) for before in flight[:j] if rng.random() < 1 / metrics}
    if refusals:
        laws["option_0", "armed"] = Law("line", -3.0)
    mediators = rng.permutation(flight).tolist()
    laws |= {(m, "time"): Law("line", float(rng.uniform(0.5, 0.9))) for m in mediators[:2]}
    laws |= {(m, "success"): Law("line", float(-rng.uniform(0.5, 0.9))) for m in mediators[1:3]}
    together = ((names[-1], names[-2], flight[-1]),)
    directed = set(laws) | {(option, metric) for a, b, metric in together for option in (a, b)}
    if refusals:
        directed |= {("armed", "success")}
    pairs = [tuple(sorted(rng.choice(flight, 2, replace=False).tolist())) for _ in range(hidden)]
    coded = {names[3]} if options > 3 else set()
    swayed: tuple[str, ...] = ()
    if chosen != "at random":
        target = mediators[1]
        swayed = (*names[:3], target)
        for name in swayed[:-1]:
            laws.setdefault((name, target), Law("line", 0.15))
            directed.add((name, target))
        if chosen == "by context":
            laws["wind", target] = Law("line", 1.2)
            directed |= {("wind", name) for name in swayed[:-1]}
        else:
            pairs += [tuple(sorted((name, target))) for name in swayed[:-1]]
    laws.setdefault(("wind", flight[0]), Law("line", 0.6))
    directed |= {("wind", m) for c, m in laws if c == "wind"}
    if chosen == "by something hidden":
        directed.discard(("wind", flight[0]))
        laws.pop(("wind", flight[0]))
    schema = _schema([*names, *(f"inert_{i}" for i in range(inert))], coded, ms, kinds, chosen)
    graph = CausalGraph(
        tuple(schema.variables),
        frozenset(edge for edge in directed if set(edge) <= set(schema.variables)),
        frozenset((a, b) for a, b in pairs),
    )
    return Robot(schema, graph, kinds, laws, together, chosen, swayed)


def _schema(
    options: list[str], coded: set[str], metrics: list[str], kinds: Mapping[str, str], chosen: Chosen
) -> Schema:
    variables = [
        Variable(name, Role.OPTION, "enum", default=0.0, labels=((0, "a"), (1, "b"), (2, "c")))
        if name in coded
        else Variable(name, Role.OPTION, range=(0.0, 1.0), default=0.5)
        for name in options
    ]
    if chosen != "by something hidden":
        variables.append(Variable("wind", Role.CONTEXT))
    variables += [Variable(m, Role.METRIC, "bool" if kinds[m] in ("bool", "armed") else "float") for m in metrics]
    variables.append(Variable("success", Role.OBJECTIVE, "bool", kind="functional", threshold=Threshold(">=", 1)))
    variables.append(Variable("time", Role.OBJECTIVE, kind="non-functional", threshold=Threshold("<=", TIME_LIMIT)))
    return Schema(
        name="robot", version="1", platform="simulated", doc="", match={}, logs=(), mission={}, evidence=(),
        observational=chosen != "at random", variables={v.name: v for v in variables},
    )  # fmt: skip


def declared_random(schema: Schema) -> Schema:
    """The same schema, wrongly declared as randomised."""
    return replace(schema, observational=False)

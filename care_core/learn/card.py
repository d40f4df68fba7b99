"""Model -> MODEL_CARD.md: what the profile was learned from, how well it predicts, and what it cannot say."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from care_core.causal.all_objectives import AllObjectives
from care_core.causal.model import UNKNOWN_CARRY_OVER, EffectRecord, Model, SkillRecord
from care_core.files import read_small_text, write_atomically
from care_core.learn.identification import identify
from care_core.metadata.causal_map import meaning_of
from care_core.metadata.screening import screened
from care_core.profile.schema import Schema
from care_core.profile.store import CARD_FILE, Profile
from care_core.variables import Role

TOP = 10
BAR = 20
OBJECTIVE_WORDS = {"all": "all objectives together"}


def model_card(schema: Schema, model: Model) -> str:
    """The card as Markdown. Same model, same card."""
    parts = [
        f"# Model card: {schema.name}",
        f"{schema.platform}. {schema.doc}".strip(),
        _data(schema, model),
        _graph(model),
        _paths(model),
        _skill(model),
        _chance(model),
        _effects(model),
        _support(schema, model),
        _screened(schema),
        _limits(schema, model),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def write_card(folder: Path, schema: Schema) -> None:
    """Write the card of the model that lies in a profile folder: there its numbers are rounded."""
    write_atomically(folder / CARD_FILE, model_card(schema, Profile(folder, schema).model))


def recomputed(profile: Profile) -> tuple[str, ...]:
    """What the learning libraries find otherwise than a profile's files hold, one sentence each: identification of
    every effect, and the model card. Raises ProfileError where the profile cannot be read."""
    model = profile.model
    found = []
    for (option, objective), effect in model.effects.items():
        answer = identify(model.graph, option, objective)
        stored = (effect.identified, effect.functional, tuple(effect.adjustment))
        if stored != (answer.identified, answer.functional, tuple(answer.adjustment)):
            found.append(f"Identification of {option} on {objective} gives another answer than the model holds.")
    card = profile.path / CARD_FILE
    if not card.is_file():
        found.append(f"There is no {CARD_FILE}.")
    elif read_small_text(card) != model_card(profile.schema, model):
        found.append(f"{CARD_FILE} is not what the model gives.")
    return tuple(found)


def _table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def _data(schema: Schema, model: Model) -> str:
    t = model.training
    how = "Options were chosen by operators (observational)" if schema.observational else "Options were set at random"
    return (
        f"## Data\n\nOrigin: {t.origin}\n\n{t.runs} runs. {how}. Seed {t.seed}, alpha {t.alpha:g}, "
        f"{t.resamples} bootstrap resamples. Trained with `care train`."
    )


def _graph(model: Model) -> str:
    strong = sum(e.support >= 0.8 for e in model.edges.values())
    text = (
        f"## Graph\n\n{len(model.graph.nodes)} nodes, {len(model.edges)} directed edges "
        f"({strong} found in at least 80% of resamples), {len(model.bidirected)} confounded pairs."
    )
    inert = [option for option in model.training.screened_out if not model.graph.children(option)]
    if inert:
        text += f"\n\nOptions that nothing was found to depend on: {', '.join(inert)}."
    if model.training.direct_edges:
        rows = ((a, b, f"{p:.2g}") for a, b, p in model.training.direct_edges)
        text += "\n\nEffects that the metrics do not carry in full, kept as direct edges:\n\n" + _table(
            ("option", "objective", "p"), rows
        )
    return text


def _paths(model: Model) -> str:
    rows = [
        (
            objective,
            str(rank),
            " -> ".join(path.nodes),
            f"{path.ace:.2f} ({path.low:.2f} to {path.high:.2f})",
            path.direction,
            " ".join(f"{share:.0%}" for share in path.edge_support),
        )
        for objective, paths in model.paths.items()
        for rank, path in enumerate(paths[:TOP], start=1)
    ]
    header = ("objective", "rank", "path", "path ACE (90% interval)", "direction", "edges in resamples")
    return "## Strongest paths\n\nMean edge effect on scaled variables (Eq. 2).\n\n" + _table(header, rows)


def _skill(model: Model) -> str:
    rows = [
        (
            OBJECTIVE_WORDS.get(name, name),
            f"{s.runs}",
            f"{s.base_rate:.2f}",
            f"{s.log_loss:.3f}",
            "none: one outcome only" if s.auc is None else f"{s.auc:.3f}",
            f"{s.calibration_error:.3f}",
        )
        for name, s in model.skill.items()
    ]
    header = ("probability of keeping the threshold of", "runs", "met", "log loss", "AUC", "calibration error")
    text = "## Skill on runs it has not seen (cross-validation)\n\n" + _table(header, rows)
    return text + (_curve(model.skill["all"]) if "all" in model.skill else "")


def _chance(model: Model) -> str:
    """What missions lose by chance, and how much of that the next one meets again."""
    counted, carried = model.training.reference, model.training.carry_over
    if counted.runs:
        lost = (counted.failed + 0.5) / (counted.runs + 1.0)
        lines = [
            f"{counted.runs} training runs were made at the reference configuration and {counted.failed} of them "
            f"missed an objective: such a mission is lost by chance in {lost:.1%} (Jeffreys)."
        ]
    else:
        lines = ["No training run was made at the reference configuration: what it loses by chance is as learned."]
    lines += [
        f"Of the noise of {name} a run under the same conditions meets {one.same:.0%} again ({one.pairs[0]} pairs of "
        f"runs), one on another day {one.another:.0%} ({one.pairs[1]} pairs)."
        for name, one in carried.items()
    ]
    if not carried:
        lines.append(
            "No configuration was run twice: a run under the same conditions is taken to meet "
            f"{UNKNOWN_CARRY_OVER.same:.0%} of the noise again, one on another day {UNKNOWN_CARRY_OVER.another:.0%}."
        )
    return "## Chance\n\n" + "\n".join(f"- {line}" for line in lines)


def _curve(skill: SkillRecord) -> str:
    """The calibration curve as a table with bars."""
    rows = ((f"{p:.2f}", f"{met:.2f}", f"{n}", f"`{_bar(p)}`<br>`{_bar(met)}`") for p, met, n in skill.curve)
    header = ("predicted", "met", "runs", "predicted above, met below")
    made = AllObjectives.of(skill.curve).of_product(np.array([0.5, 0.75, 0.9]))
    said = ", ".join(f"{promised:.2f}" for promised in made)
    return (
        "\n\nCalibration of the probability that all objectives are met, as the product of the single ones:\n\n"
        + _table(header, rows)
        + f"\n\nWhat is promised follows these runs: {said} for products of 0.50, 0.75, 0.90."
    )


def _bar(share: float) -> str:
    full = round(share * BAR)
    return "#" * full + "." * (BAR - full)


def _effects(model: Model) -> str:
    ranked = sorted(model.effects.values(), key=lambda e: (e.objective, -e.effect))
    rows = []
    for objective in dict.fromkeys(e.objective for e in ranked):
        for e in [e for e in ranked if e.objective == objective][:TOP]:
            known = _identified(e)
            seen = "" if e.support is None else f"{e.support:.0%}"
            size = f"{e.effect:.2f} ({e.low:.2f} to {e.high:.2f})"
            rows.append((objective, e.option, size, e.direction, seen, known))
    header = ("objective", "option", "effect (90% interval)", "direction", "path in resamples", "identified")
    return "## Total effects\n\nEq. 1 on scaled variables.\n\n" + _table(header, rows)


def _identified(effect: EffectRecord) -> str:
    if not effect.identified:
        return "only through metrics: not ranked" if effect.functional else "no: not ranked"
    return f"given {', '.join(effect.adjustment)}" if effect.adjustment else "yes"


def _support(schema: Schema, model: Model) -> str:
    rows = [
        (o.name, f"{s.low:g} to {s.high:g}", "" if o.range is None else f"{o.range[0]:g} to {o.range[1]:g}", o.unit)
        for o in schema.options
        if (s := model.summaries.get(o.name)) is not None
    ]
    return "## Support\n\n" + _table(("option", "in the training runs", "acceptable", "unit"), rows)


def _screened(schema: Schema) -> str:
    """What is known of parameters that the profile does not model, by what they belong to."""
    kind = schema.match.get("vehicle", "")
    modelled = {name for option in schema.options for name in option.parameters}
    parts: dict[str, list[str]] = {}
    for name in screened(kind):
        meaning = meaning_of(name, kind)
        if name not in modelled:
            parts.setdefault(meaning.part if meaning is not None else "others", []).append(name)
    if not parts:
        return ""
    rows = ((part, ", ".join(sorted(names))) for part, names in sorted(parts.items()))
    text = (
        f"## Parameters outside the profile that were screened\n\n{sum(map(len, parts.values()))} were flown or driven "
        "in the simulator with wrong values, one at a time: of these it is known which values lose a mission, and how "
        "that shows. Of any other only what documentation and source say.\n\n"
    )
    return text + _table(("part", "parameters"), rows)


def _limits(schema: Schema, model: Model) -> str:
    lines = [
        "Holds for this platform, this mission and the ranges above; outside them a diagnosis says so.",
        "An effect says what changing an option does on average, not that it caused every fault.",
    ]
    if schema.learned_elsewhere:
        lines.append(
            f"For any log {schema.learned_elsewhere}: no confidence is above low, no change is advised and no limit "
            "is judged unless it is given, until `care update` has carried it over to runs of the robot itself."
        )
    unread = [v.name for v in schema.variables.values() if v.role is not Role.OPTION and v.extract is None]
    if schema.logs and unread:
        lines.append(f"No log can tell: {', '.join(unread)}.")
    unpredicted = [o.name for o in schema.objectives if o.name not in model.outcomes]
    if unpredicted:
        lines.append(f"No option was found to move: {', '.join(unpredicted)}. Their faults are never explained.")
    lines += list(model.training.notes)
    return "## Limits\n\n" + "\n".join(f"- {line}" for line in lines)

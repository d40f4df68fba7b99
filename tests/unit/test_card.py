from __future__ import annotations

from pathlib import Path

from care_core.causal.graph import CausalGraph
from care_core.causal.model import UNKNOWN_CARRY_OVER, ReferenceRuns, SkillRecord
from care_core.learn.card import model_card, recomputed, write_card
from care_core.profile.model import write_model
from care_core.profile.store import Profile
from care_core.records import replace
from tests.planted import SCHEMA


def test_the_card_tells_what_the_model_is_made_of(planted: Profile) -> None:
    card = model_card(SCHEMA, planted.model)
    assert card == model_card(SCHEMA, planted.model)
    assert card.startswith("# Model card: planted\n")
    for part in ("Data", "Graph", "Strongest paths", "Skill", "Chance", "Total effects", "Support", "Limits"):
        assert f"\n## {part}" in card
    assert "250 runs" in card
    assert "simulated" in card
    assert "reserve -> hold_s -> time" in card
    assert "all objectives together" in card
    assert "set at random" in card
    assert "nan" not in card


def test_the_card_tells_what_is_lost_by_chance(planted: Profile) -> None:
    counted = replace(planted.model.training, reference=ReferenceRuns(runs=49, failed=2), carry_over={})
    card = model_card(SCHEMA, replace(planted.model, training=counted))
    assert "49 training runs were made at the reference configuration and 2 of them missed" in card
    assert "lost by chance in 5.0%" in card
    assert "No configuration was run twice" in card


def test_tables_have_as_many_cells_as_heads(planted: Profile) -> None:
    lines = model_card(SCHEMA, planted.model).splitlines()
    widths = [line.count("|") for line in lines if line.startswith("|")]
    starts = [i for i, line in enumerate(lines) if line.startswith("|---")]
    for i in starts:
        block = []
        for line in lines[i - 1 :]:
            if not line.startswith("|"):
                break
            block.append(line.count("|"))
        assert len(set(block)) == 1
    assert widths


def test_what_the_model_cannot_say_is_said(planted: Profile) -> None:
    model = planted.model
    outcomes = {name: outcome for name, outcome in model.outcomes.items() if name != "energy"}
    effects = dict(model.effects)
    effects["speed", "time"] = replace(effects["speed", "time"], identified=False, functional="")
    training = replace(
        model.training,
        screened_out=("inert",),
        direct_edges=(("planner", "time", 1e-5),),
        notes=("'filter' never varies in the table.",),
    )
    bare = replace(
        model,
        outcomes=outcomes,
        graph=CausalGraph(model.graph.nodes, frozenset(e for e in model.graph.directed if e[0] != "inert")),
        effects=effects,
        training=training,
        skill={"all": score_of_one()},
    )
    card = model_card(replace(SCHEMA, observational=True), bare)
    assert "No option was found to move: energy" in card
    assert "no: not ranked" in card
    assert "depend on: inert" in card
    assert "| planner | time | 1e-05 |" in card
    assert "- 'filter' never varies in the table." in card
    assert "observational" in card
    assert "one outcome only" in card
    assert "| 0.90 | 1.00 | 9 | `##################..`<br>`####################` |" in card


def score_of_one() -> SkillRecord:
    """Skill where every run met its thresholds: there is no AUC."""
    return SkillRecord(runs=9, base_rate=1.0, log_loss=0.1, brier=0.0, calibration_error=0.1, curve=((0.9, 1.0, 9),))


def test_a_vehicles_card_names_the_parameters_that_were_screened(planted: Profile) -> None:
    assert "were screened" not in model_card(SCHEMA, planted.model)
    card = model_card(replace(SCHEMA, match={"vehicle": "rover"}), planted.model)
    compass = next(line for line in card.splitlines() if line.startswith("| compass |"))
    assert "COMPASS_ORIENT" in compass
    assert "WP_SPEED" not in card.partition("were screened")[2], "what a rover's profile models was not screened so"


def test_the_card_is_that_of_the_model_as_it_is_written(planted: Profile, tmp_path: Path) -> None:
    """In memory 0.9749999 is 97%, in the file 0.975, which is 98%."""
    shares = {"time": replace(UNKNOWN_CARRY_OVER, same=0.97499999)}
    model = replace(planted.model, training=replace(planted.model.training, carry_over=shares))
    write_model(model, tmp_path)
    write_card(tmp_path, SCHEMA)
    assert recomputed(Profile(tmp_path, SCHEMA)) == ()
    assert model_card(SCHEMA, model) != (tmp_path / "MODEL_CARD.md").read_text()

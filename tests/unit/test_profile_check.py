from __future__ import annotations

from pathlib import Path

import pytest

from care_core.causal.model import Model
from care_core.profile.check import problems
from care_core.profile.store import Profile, available_profiles, load_profile
from care_core.records import replace
from tests.conftest import Care


def with_model(planted: Profile, model: Model) -> Profile:
    profile = Profile(planted.path, planted.schema)
    profile.__dict__["model"] = model
    return profile


@pytest.mark.parametrize("path", available_profiles(), ids=lambda path: path.name)
def test_bundled_profiles_contradict_nothing(path: Path) -> None:
    assert problems(load_profile(path)) == ()


def test_a_sound_profile_has_no_problems(planted: Profile) -> None:
    assert problems(planted) == ()


def test_edited_effects_are_noticed(planted: Profile) -> None:
    edges = dict(planted.model.edges)
    path = next(path for paths in planted.model.paths.values() for path in paths)
    edge = path.nodes[0], path.nodes[1]
    edges[edge] = replace(edges[edge], effect=edges[edge].effect + 1)
    found = problems(with_model(planted, replace(planted.model, edges=edges)))
    assert any(" -> ".join(path.nodes) in sentence and "its edges give" in sentence for sentence in found)


def test_edited_weights_are_noticed(planted: Profile) -> None:
    key, mechanism = next(iter(planted.model.mechanisms.items()))
    changed = {**planted.model.mechanisms, key: replace(mechanism, weights=mechanism.weights + 0.1)}
    assert problems(with_model(planted, replace(planted.model, mechanisms=changed))) == (
        f"The weights of '{key}' do not follow from its points and targets.",
    )


def test_an_edge_into_an_option_is_noticed(planted: Profile) -> None:
    edge = next(iter(planted.model.edges.values()))
    wrong = replace(edge, source="time", target="speed")
    found = problems(
        with_model(planted, replace(planted.model, edges={**planted.model.edges, ("time", "speed"): wrong}))
    )
    assert "time -> speed: nothing causes an option." in found


def test_the_command_says_what_is_wrong(care: Care, tmp_path: Path) -> None:
    source = load_profile("husky-care").path
    for name in ("profile.yaml", "model.json", "mechanisms.npz"):
        (tmp_path / name).write_bytes((source / name).read_bytes())
    (tmp_path / "MODEL_CARD.md").write_text("# Model card: something else\n")
    outcome = care("profiles", "check", tmp_path)
    assert outcome.code == 2
    assert "husky-care: not sound" in outcome.stdout
    assert "MODEL_CARD.md is not what the model gives." in outcome.stdout
    assert care("profiles", "check", "husky-care").code == 0

"""What of a profile only the learning libraries can recompute: identification of every effect, and the model card."""

from __future__ import annotations

from care_core.learn.card import model_card
from care_core.learn.identification import identify
from care_core.profile.store import Profile

CARD_FILE = "MODEL_CARD.md"


def recomputed(profile: Profile) -> tuple[str, ...]:
    """What differs from the files, one sentence each. Raises ProfileError where the profile cannot be read."""
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
    elif card.read_text(encoding="utf-8") != model_card(profile.schema, model):
        found.append(f"{CARD_FILE} is not what the model gives.")
    return tuple(found)

from __future__ import annotations

import numpy as np
import pytest

from care_core.learn.choices import chosen_together
from care_core.learn.identification import identify
from care_core.learn.structure import learn_structure
from tests.robots import random_robot
from tests.simulated import simulate

SWAYED = {"option_0", "option_1", "option_2"}


def test_randomised_tables_are_not_asked() -> None:
    frame, schema, _ = simulate(300, np.random.default_rng(0))
    options = [o.name for o in schema.options]
    assert chosen_together(frame.assign(option_1=frame.option_0), schema, options) == {}


@pytest.mark.parametrize("seed", range(3))
def test_a_reason_in_the_table_explains_the_choices_and_a_hidden_one_does_not(seed: int) -> None:
    for chosen, found in (("by context", set()), ("by something hidden", SWAYED)):
        robot = random_robot(np.random.default_rng(seed), chosen=chosen)  # type: ignore[arg-type]
        frame = robot.drive(600, np.random.default_rng(seed))
        options = [o.name for o in robot.schema.options]
        together = chosen_together(frame, robot.schema, options)
        assert set(together) == found
        assert set(together.values()) <= found


def test_options_chosen_for_a_hidden_reason_are_not_identified() -> None:
    robot = random_robot(np.random.default_rng(0), chosen="by something hidden")
    frame = robot.drive(800, np.random.default_rng(0))
    structure = learn_structure(frame, robot.schema, rng=np.random.default_rng(0))
    for objective in ("success", "time"):
        for option in SWAYED & structure.graph.ancestors(objective):
            assert not identify(structure.graph, option, objective).identified
    assert sum("for a reason that no context holds" in note for note in structure.notes) == len(SWAYED)

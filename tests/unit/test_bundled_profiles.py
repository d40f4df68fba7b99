"""Every profile that ships is sound: it reads, and what it names exists."""

from __future__ import annotations

from pathlib import Path

import pytest

from care_core.ecosystems.measures import MISSION_KINDS, find_extractor
from care_core.extract.read import reading_plan
from care_core.profile.reading import read_schema
from care_core.profile.schema import Schema
from care_core.variables import Role

PROFILES = sorted((Path(__file__).resolve().parents[2] / "profiles").glob("*/profile.yaml"))


@pytest.fixture(params=PROFILES, ids=lambda path: path.parent.name)
def schema(request: pytest.FixtureRequest) -> Schema:
    return read_schema(request.param)


def test_there_are_profiles() -> None:
    assert {"move_base", "husky", "turtlebot3", "husky-care"} <= {path.parent.name for path in PROFILES}


def test_name_is_the_folder(schema: Schema) -> None:
    assert schema.name in {path.parent.name for path in PROFILES}


def test_options_say_what_they_are(schema: Schema) -> None:
    for option in schema.options:
        assert option.parameters, option.name
        assert option.doc, option.name
        assert option.range is not None or option.labels, option.name
        assert option.default is None or option.accepts(option.default), option.name
        assert not any(parameter.startswith("SIM_") for parameter in option.parameters)


def test_an_option_has_its_own_parameters(schema: Schema) -> None:
    parameters = [parameter for option in schema.options for parameter in option.parameters]
    assert len(parameters) == len(set(parameters))


def test_objectives_have_thresholds(schema: Schema) -> None:
    assert any(objective.kind == "functional" for objective in schema.objectives)
    assert all(objective.threshold for objective in schema.objectives)


def test_extraction_names_what_exists(schema: Schema) -> None:
    if not schema.logs:
        assert all(variable.extract is None for variable in schema.variables.values())
        return
    kind = MISSION_KINDS[str(schema.mission["kind"])]
    assert set(schema.mission) - {"kind"} <= set(kind.args)
    assert reading_plan(schema)
    for variable in schema.variables.values():
        if variable.role is Role.OPTION:
            continue
        assert variable.extract is not None or schema.carried_over, variable.name
        if variable.extract is None:
            continue
        found = find_extractor(variable.extract.kind)
        assert set(variable.extract.args) <= set(found.args), variable.name


def test_evidence_rules_point_at_options(schema: Schema) -> None:
    options = {option.name for option in schema.options}
    for rule in schema.evidence:
        assert rule.pattern.pattern
        assert set(rule.options) <= options

"""Reports from strangers: what they may set, and what is refused with the file and the key."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from care_core.errors import ConfigError
from care_core.files import bundled
from care_core.profile.store import load_profile
from care_core.report.document import ChangeEntry, FixSet
from care_core.report.suggested import check_acceptable, suggested_changes
from tests.conftest import Care

SAMPLE = bundled("samples", "arducopter_failed.BIN")
GOOD = Path(__file__).parents[1] / "data/arducopter_good.BIN"
Edited = Callable[..., Path]


@pytest.fixture(scope="module")
def document(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    import care_core

    case = care_core.triage(SAMPLE)
    made: dict[str, Any] = json.loads(case.report("json"))
    return made


@pytest.fixture
def edited(document: dict[str, Any], tmp_path: Path) -> Edited:
    """Write the report with its change, or any of its keys, altered."""

    def write(change: dict[str, Any] | None = None, **keys: Any) -> Path:
        report = json.loads(json.dumps({**document, **keys}))
        if change:
            report["fix"]["changes"][0].update(change)
        path = tmp_path / "report.json"
        path.write_text(json.dumps(report), encoding="utf-8")
        return path

    return write


@pytest.fixture
def params(tmp_path: Path) -> Path:
    path = tmp_path / "ours.param"
    path.write_text("LAND_SPEED,16\nARMING_CHECK,1\nBATT_LOW_VOLT,10.5\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"parameter": "ARMING_CHECK", "to": 0}, "parameter"),
        ({"parameter": ["LAND_SPEED", "ARMING_CHECK"]}, "parameter"),
        ({"parameter": ["LAND_SPEED", "LAND_SPEED"]}, "parameter"),
        ({"parameter": []}, "parameter"),
        ({"parameter": "LAND_SPEED_X,1\nARMING_CHECK,0\n#"}, "parameter"),
        ({"parameter": "LAND_SPEED "}, "parameter"),
        ({"parameter": "$(touch /tmp/x)"}, "parameter"),
        ({"parameter": "WPNAV_SPEED"}, "parameter"),
        ({"option": "ARMING_CHECK", "parameter": "ARMING_CHECK", "to": 0}, "option"),
        ({"option": "mission_time"}, "option"),
        ({"option": "wind_lean"}, "option"),
        ({"to": 1e300}, "to"),
        ({"to": -1}, "to"),
        ({"to": 0}, "to"),
        ({"to": 10**9}, "to"),
        ({"to": 40.5}, "to"),
        ({"parameter": "LAND_SPD_MS", "to": 40}, "to"),
    ],
    ids=str,
)
@pytest.mark.parametrize("way", [(), ("--in-place",), ("--override",)], ids=str)
def test_a_report_sets_its_own_parameter_to_an_acceptable_value_alone(
    care: Care, edited: Edited, params: Path, change: dict[str, Any], key: str, way: tuple[str, ...]
) -> None:
    before, report = params.read_bytes(), edited(change)
    code, out, err = care("apply", report, params, *way)
    assert (code, out) == (2, "")
    assert str(report) in err
    assert f"fix.changes[0].{key}" in err
    assert params.read_bytes() == before
    assert "\n" not in err.strip()


@pytest.mark.parametrize(
    ("change", "keys"),
    [
        ({"to": "40"}, {}),
        ({"to": None}, {}),
        ({"to": True}, {}),
        ({"to": int("9" * 400)}, {}),
        ({"from": int("9" * 400)}, {}),
        ({"to": float("nan")}, {}),
        ({"to": float("inf")}, {}),
        ({"option": ["LAND_SPEED"]}, {}),
        ({"shell": "reboot"}, {}),
        (None, {"fix": 3}),
        (None, {"profile": "arducopter"}),
        (None, {"config": {"LAND_SPEED": "16"}}),
        (None, {"objectives": [{"name": "mission_time"}]}),
    ],
    ids=lambda one: str(one)[:40],
)
@pytest.mark.parametrize("command", ["apply", "verify", "diff"])
def test_every_field_is_checked_by_its_type(
    care: Care, edited: Edited, params: Path, command: str, change: dict[str, Any] | None, keys: dict[str, Any]
) -> None:
    report = edited(change, **keys)
    code, out, err = care(command, report, GOOD if command == "verify" else params)
    assert (code, out) == (2, "")
    assert str(report) in err


@pytest.mark.parametrize("share", [7, -0.1])
def test_a_probability_is_one(care: Care, edited: Edited, document: dict[str, Any], share: float) -> None:
    code, _, err = care("verify", edited(fix={**document["fix"], "p_fixed": share}), GOOD)
    assert code == 2
    assert "fix.p_fixed" in err


def test_a_fix_without_changes_promises_nothing(care: Care, edited: Edited, document: dict[str, Any]) -> None:
    code, _, err = care("verify", edited(fix={**document["fix"], "changes": []}), GOOD)
    assert code == 2
    assert "fix.changes" in err


def test_alternatives_are_held_to_the_same(care: Care, edited: Edited, document: dict[str, Any], params: Path) -> None:
    other = {**document["fix"]["changes"][0], "parameter": "ARMING_CHECK"}
    alternative = {name: document["fix"][name] for name in ("p_fixed", "predicted")} | {"changes": [other]}
    report = edited(fix={**document["fix"], "alternatives": [alternative]})
    assert care("apply", report, params).code == 0
    code, _, err = care("apply", report, params, "--alternative", "1")
    assert code == 2
    assert "fix.alternatives[0].changes[0].parameter" in err
    assert care("verify", report, GOOD).code == 2


def test_a_renamed_spelling_is_the_options_own() -> None:
    schema = load_profile("arducopter").schema

    def of(parameter: str, to: float) -> tuple[float, tuple[str, ...]]:
        entry = ChangeEntry(
            option="LAND_SPEED", parameter=parameter, from_=0.16, to=to, assumed=False, reboot_required=False
        )
        (change,) = suggested_changes(FixSet(changes=[entry], p_fixed=0.9, predicted={}), schema, Path("r"), "fix")
        check_acceptable(change, Path("r"))
        return change.value, change.option.parameters

    assert of("LAND_SPD_MS", 0.4) == (40.0, ("LAND_SPD_MS",))
    with pytest.raises(ConfigError, match="never set to 4000"):
        of("LAND_SPD_MS", 40)


@pytest.mark.parametrize(
    ("held", "to", "is_done"),
    [
        ("9.8", 10.0, True), ("9.8", 10.5, True), ("11", 10.6, True), ("10.5", 10.5, True),
        ("10.5", 10.0, False), ("10.5", 11.0, False), ("9.8", 9.7, False), ("9.8", 11.0, False), ("11", 10.4, False),
        (None, 10.5, True), (None, 10.4, False), (None, 11.0, False),
    ],
)  # fmt: skip
def test_a_safety_parameter_is_never_loosened_whatever_the_report_says_it_was(
    care: Care, edited: Edited, tmp_path: Path, held: str | None, to: float, is_done: bool
) -> None:
    """The default is 10.5 V. Which way is loose nobody says, so it moves from what the file has to there."""
    path = tmp_path / "b.param"
    path.write_text(f"BATT_LOW_VOLT,{held}\n" if held else "LAND_SPEED,16\n", encoding="utf-8")
    report = edited({"option": "BATT_LOW_VOLT", "parameter": "BATT_LOW_VOLT", "from": 9.7, "to": to})
    code, _, err = care("apply", report, path, "-o", tmp_path / "new.param")
    assert (code == 0) == is_done, err
    if not is_done:
        assert "safety" in err
        assert not (tmp_path / "new.param").exists()


@pytest.mark.parametrize("way", ["--in-place", "-o"])
def test_a_file_that_does_not_read_back_stays_what_it_was(
    care: Care, edited: Edited, params: Path, monkeypatch: pytest.MonkeyPatch, way: str
) -> None:
    from care_core import files

    real, before, new = files.write_atomically, params.read_bytes(), params.with_name("new.param")

    def lossy(path: Path, text: str, mode: int | None = None) -> None:
        real(path, text.replace("LAND_SPEED,40", "LAND_SPEED,4"), mode)

    monkeypatch.setattr("care_core.configs.writing.write_atomically", lossy)
    code, _, err = care("apply", edited(), params, *(("-o", new) if way == "-o" else (way,)))
    assert code == 2
    assert "does not hold the changes" in err
    assert params.read_bytes() == before
    assert not new.exists()


@pytest.mark.parametrize(
    "name", ["../../evil", "/tmp/evil", "evil", "./evil", "evil/profile.yaml", "arducopter/../evil"]
)
@pytest.mark.parametrize("command", ["apply", "verify", "diff"])
def test_a_report_names_a_profile_never_a_folder(
    care: Care, edited: Edited, params: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, name: str, command: str
) -> None:
    """The bundled profile lies in every place that the report leads to."""
    here = tmp_path / "a/b"
    here.mkdir(parents=True)
    for folder in (here / "evil", tmp_path / "evil"):
        folder.symlink_to(bundled("profiles", "arducopter"))
    monkeypatch.chdir(here)
    report = edited(profile={"name": name, "version": "2", "platform": "ArduCopter"})
    code, _, err = care(command, report, GOOD if command == "verify" else params)
    assert code == 2
    assert f"There is no profile '{name}'" in err
    assert "profile.name" in err
    if command != "diff":
        assert care(command, report, GOOD if command == "verify" else params, "--profile", "./evil").code == 0

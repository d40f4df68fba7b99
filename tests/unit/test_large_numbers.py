"""Numbers of hundreds of digits, which no float and no robot holds: refused in a sentence wherever a file has one."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

import care_core
from care_core.collect.campaign import read_campaign
from care_core.configs.loading import read_config
from care_core.errors import CareError
from care_core.files import bundled
from care_core.profile.model import read_model
from care_core.profile.reading import read_schema
from care_core.profile.site import load_site
from care_core.report.reading import read_report
from care_tui.settings import load_settings

NUMBERS = {"400 digits": "9" * 400, "below zero": "-" + "9" * 400, "5000 digits": "9" * 5000}
CONFIGS = {
    "ros1.yaml": "move_base:\n  DWAPlannerROS:\n    max_vel_x: ?\n",
    "ros2.yaml": "controller_server:\n  ros__parameters:\n    max_vel_x: ?\n",
    "a.param": "LAND_SPEED,?\n",
    "a.parm": "LAND_SPEED ?\n",
    "px4.params": "1\t1\tMPC_XY_VEL_MAX\t?\t9\n",
}
PROFILE = bundled("profiles", "arducopter")


@pytest.fixture(scope="module")
def reports() -> dict[str, str]:
    case = care_core.triage(bundled("samples", "arducopter_failed.BIN"))
    return {format: case.report(format) for format in ("json", "yaml")}


@pytest.mark.parametrize("number", NUMBERS)
@pytest.mark.parametrize("name", CONFIGS)
def test_in_a_configuration(tmp_path: Path, name: str, number: str) -> None:
    path = tmp_path / name
    path.write_text(CONFIGS[name].replace("?", NUMBERS[number]))
    with pytest.raises(CareError, match=re.escape(name)):
        read_config(path)


def test_endless_is_a_value_of_yaml_and_of_no_parameter_file(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(CONFIGS["ros2.yaml"].replace("?", ".inf"))
    assert [one.value for one in read_config(tmp_path / "a.yaml").values()] == [float("inf")]
    (tmp_path / "a.param").write_text("LAND_SPEED,1e999\n")
    with pytest.raises(CareError, match="larger than any number"):
        read_config(tmp_path / "a.param")


@pytest.mark.parametrize("number", [*NUMBERS.values(), "1e999"], ids=[*NUMBERS, "1e999"])
@pytest.mark.parametrize("key", ["WPNAV_SPEED", "duration_s", "rank", "value"])
@pytest.mark.parametrize("format", ["json", "yaml"])
def test_in_a_report(reports: dict[str, str], tmp_path: Path, format: str, key: str, number: str) -> None:
    path = tmp_path / f"report.{format}"
    path.write_text(re.sub(rf'("?{key}"?: )[\d.]+', rf"\g<1>{number}", reports[format], count=1))
    with pytest.raises(CareError, match=r"report\.(json|yaml)"):
        read_report(path)


@pytest.mark.parametrize("number", NUMBERS)
def test_in_a_profile_site_campaign_and_settings(tmp_path: Path, number: str) -> None:
    digits = NUMBERS[number]
    site = tmp_path / "site.yaml"
    site.write_text(f'schema: care.site/1\nlimits:\n  arducopter:\n    energy: {{op: "<=", value: {digits}}}\n')
    with pytest.raises(CareError):
        load_site(site)
    profile = tmp_path / "profile.yaml"
    text = (PROFILE / "profile.yaml").read_text()
    profile.write_text(re.sub(r"default: [\d.]+", f"default: {digits}", text, count=1))
    with pytest.raises(CareError):
        read_schema(profile)
    campaign = tmp_path / "campaign.yaml"
    campaign.write_text(f"schema_version: 1\nprofile: arducopter\ncommand: x\nparameters: a\nruns: {digits}\n")
    with pytest.raises(CareError):
        read_campaign(campaign)
    settings = tmp_path / "settings.yaml"
    settings.write_text(f"fps: {digits}\n")
    with pytest.raises(CareError):
        load_settings(settings)
    shutil.copytree(PROFILE, tmp_path / "own")
    model = tmp_path / "own" / "model.json"
    model.write_text(re.sub(r'("model_version": )\d+', rf"\g<1>{digits}", model.read_text()))
    with pytest.raises(CareError):
        read_model(tmp_path / "own")

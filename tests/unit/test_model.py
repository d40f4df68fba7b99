from __future__ import annotations

import hashlib
import io
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from care_core.causal.model import Summary
from care_core.errors import ProfileError
from care_core.profile.model import read_model, write_model
from care_core.profile.store import Profile
from care_core.records import replace
from tests.planted import DEFAULTS

Arrays = dict[str, np.ndarray[Any, Any]]


@pytest.fixture
def folder(planted: Profile, tmp_path: Path) -> Path:
    copy = tmp_path / "copy"
    copy.mkdir()
    for name in ("model.json", "mechanisms.npz"):
        shutil.copy(planted.path / name, copy)
    return copy


def edit_json(folder: Path, change: Callable[[dict[str, Any]], object]) -> None:
    data = json.loads((folder / "model.json").read_text())
    change(data)
    (folder / "model.json").write_text(json.dumps(data))


def edit_arrays(folder: Path, change: Callable[[Arrays], object]) -> None:
    with np.load(folder / "mechanisms.npz") as stored:
        arrays = dict(stored)
    change(arrays)
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    (folder / "mechanisms.npz").write_bytes(buffer.getvalue())
    digest = hashlib.sha256(buffer.getvalue()).hexdigest()
    edit_json(folder, lambda data: data.update(arrays_sha256=digest))


def test_what_is_written_is_read(planted: Profile, folder: Path) -> None:
    model = planted.model
    write_model(model, folder)
    again = read_model(folder)
    for part in ("graph", "edges", "bidirected", "effects", "paths", "outcomes", "summaries", "skill", "training"):
        assert getattr(again, part) == getattr(model, part), part
    row = np.array(list(DEFAULTS.values()))
    for key, mechanism in model.mechanisms.items():
        x = row[None, : len(mechanism.inputs)]
        np.testing.assert_array_equal(again.mechanisms[key].expected(x), mechanism.expected(x))
    for name in ("model.json", "mechanisms.npz"):
        assert (folder / name).read_bytes() == (planted.path / name).read_bytes()
    assert sorted(p.name for p in folder.iterdir()) == ["mechanisms.npz", "model.json"]


def test_model_json_is_json_for_everybody(planted: Profile) -> None:
    def refuse(constant: str) -> None:
        raise AssertionError(f"{constant} is not JSON")

    json.loads((planted.path / "model.json").read_text(), parse_constant=refuse)


def test_a_model_that_is_not_a_number_is_not_written(planted: Profile, folder: Path) -> None:
    with pytest.raises(ValueError, match="finite"):
        write_model(replace(planted.model, correlated_metrics={"time": {"mean_speed": float("nan")}}), folder)
    assert read_model(folder).correlated_metrics == planted.model.correlated_metrics


@pytest.mark.parametrize("name", ["model.json", "mechanisms.npz"])
@pytest.mark.parametrize(
    "damage",
    [
        lambda data: b"",
        lambda data: data[: len(data) // 2],
        lambda data: data[: len(data) // 3] + b"\x00\xff\x80garbage" * 8 + data[len(data) // 3 + 88 :],
        lambda data: b"PK\x03\x04 not an archive",
        lambda data: b"\x93NUMPY",
        lambda data: b"{}",
        lambda data: b"[1, 2]",
        lambda data: b"\x80\x04\x95 a pickle",
    ],
    ids=["empty", "cut", "garbage", "zip", "npy", "braces", "list", "pickle"],
)
def test_a_damaged_file_is_a_profile_error(folder: Path, name: str, damage: Callable[[bytes], bytes]) -> None:
    path = folder / name
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(ProfileError) as caught:
        read_model(folder)
    assert str(folder) in caught.value.where
    assert "care train" in caught.value.hint
    assert "unsafe" not in str(caught.value)


@pytest.mark.parametrize("cut", range(0, 100, 7))
def test_an_archive_cut_anywhere_is_a_profile_error(folder: Path, cut: int) -> None:
    path = folder / "mechanisms.npz"
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * cut // 100])
    with pytest.raises(ProfileError):
        read_model(folder)


@pytest.mark.parametrize("place", range(5, 100, 9))
def test_a_byte_turned_over_never_escapes_as_a_traceback(folder: Path, place: int) -> None:
    path = folder / "mechanisms.npz"
    data = bytearray(path.read_bytes())
    for i in range(8):
        data[len(data) * place // 100 + i] ^= 0xFF
    whole = read_model(folder).mechanisms
    path.write_bytes(bytes(data))
    try:
        read = read_model(folder).mechanisms
    except ProfileError:
        return
    # Not every byte of an archive says something: what is read all the same is what was written.
    assert all((read[key].weights == whole[key].weights).all() for key in whole)


def test_a_plain_array_in_place_of_an_archive(folder: Path) -> None:
    buffer = io.BytesIO()
    np.save(buffer, np.zeros(3))
    (folder / "mechanisms.npz").write_bytes(buffer.getvalue())
    with pytest.raises(ProfileError):
        read_model(folder)


class Trap:
    """Unpickling this would write a file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return (Path.write_text, (self.path, "unpickled"))


def test_a_pickled_array_is_refused_and_never_run(folder: Path) -> None:
    trap = folder / "trap"

    def plant(arrays: Arrays) -> None:
        arrays["time/points"] = np.array([Trap(trap)], dtype=object)

    edit_arrays(folder, plant)
    with pytest.raises(ProfileError) as caught:
        read_model(folder)
    assert caught.value.message == "The model is damaged: time/points holds no numbers."
    assert not trap.exists()


@pytest.mark.parametrize(
    "change",
    [
        lambda a: a.pop("time/points"),
        lambda a: a.update({"time/points": a["time/points"][:, 1:]}),
        lambda a: a.update({"time/points": a["time/points"].ravel()}),
        lambda a: a.update({"time/targets": a["time/targets"][:-1]}),
        lambda a: a.update({"time/targets": a["time/targets"] * np.nan}),
        lambda a: a.update({"time/scaling": a["time/scaling"][:3]}),
        lambda a: a.update({"time/scaling": a["time/scaling"][:, 1:]}),
        lambda a: a.update({"time/numbers": a["time/numbers"][:2]}),
        lambda a: a.update({"time/calibration": np.zeros(0)}),
        lambda a: a.update({"time/calibration": np.zeros((2, 2))}),
        lambda a: a.update({"stage:armed/calibration": np.zeros(3)}),
        lambda a: a.update({"time/points": np.full(a["time/points"].shape, "x")}),
        lambda a: a.update({"time/points": a["time/points"].astype(float) * 1e30}),
        lambda a: a.update({"time/numbers": np.full_like(a["time/numbers"], 1e300)}),
        lambda a: a.update({"time/numbers": -np.abs(a["time/numbers"])}),
        lambda a: a.update({"time/scaling": -np.abs(a["time/scaling"])}),
    ],
)
def test_arrays_that_do_not_fit_are_a_profile_error(folder: Path, change: Callable[[Arrays], object]) -> None:
    edit_arrays(folder, change)
    with pytest.raises(ProfileError, match="damaged"):
        read_model(folder)


@pytest.mark.parametrize(
    "change",
    [
        lambda d: d.update(model_version=2),
        lambda d: d.update(surprise=1),
        lambda d: d.pop("nodes"),
        lambda d: d["edges"][0].update(source="nobody"),
        lambda d: d["edges"].append(
            {**d["edges"][0], "source": d["edges"][0]["target"], "target": d["edges"][0]["source"]}
        ),
        lambda d: d["edges"][0].update(kind="undirected"),
        lambda d: d["edges"][0].update(effect=float("nan")),
        lambda d: d["nodes"].append(d["nodes"][0]),
        lambda d: d["outcomes"][0]["stages"][0].update(mechanism="stage:nobody"),
        lambda d: d["mechanisms"].pop("time"),
        lambda d: d["mechanisms"]["time"].update(transform="sqrt"),
        lambda d: d["summaries"]["speed"].update(quantiles=[]),
    ],
)
def test_a_model_that_does_not_hold_together_is_a_profile_error(
    folder: Path, change: Callable[[dict[str, Any]], object]
) -> None:
    edit_json(folder, change)
    with pytest.raises(ProfileError) as caught:
        read_model(folder)
    assert "care train" in caught.value.hint


@pytest.mark.parametrize("step", range(4))
def test_a_model_whose_writing_is_broken_off_is_the_old_or_the_new_one(
    planted: Profile, folder: Path, monkeypatch: pytest.MonkeyPatch, step: int
) -> None:
    """Three files get their names one after the other, and a kill may come before each."""
    other = {key: replace(mechanism, mean=mechanism.mean + 1) for key, mechanism in planted.model.mechanisms.items()}
    new, rename, names = replace(planted.model, schema_digest="new", mechanisms=other), Path.replace, list[str]()

    def renamed(path: Path, target: Path) -> Path:
        if len(names) == step:
            raise KeyboardInterrupt
        names.append(Path(target).name)
        return rename(path, target)

    monkeypatch.setattr(Path, "replace", renamed)
    try:
        write_model(new, folder)
    except KeyboardInterrupt:
        assert len(names) == step < 3
    found = read_model(folder)
    expected = new if found.schema_digest == "new" else planted.model
    assert {key: one.mean for key, one in found.mechanisms.items()} == pytest.approx(
        {key: one.mean for key, one in expected.mechanisms.items()}
    )
    assert (found.schema_digest == "new") == (step >= 2)


@pytest.mark.parametrize("name", ["model.json", "mechanisms.npz"])
def test_a_missing_file_says_to_train(folder: Path, name: str) -> None:
    (folder / name).unlink()
    with pytest.raises(ProfileError, match="no readable model") as caught:
        read_model(folder)
    assert "care train" in caught.value.hint


@given(st.lists(st.floats(-1e6, 1e6), min_size=21, max_size=21).map(sorted), st.floats(-2e6, 2e6), st.floats(0, 1e6))
@example([*[0.0] * 20, 2.2250738585e-313], 0.0, 5e-324)
@example([*[0.0] * 19, 2.2250738585e-313, 2.0], 5e-324, 1.0)
def test_a_percentile_is_a_share_that_never_falls(quantiles: list[float], value: float, more: float) -> None:
    summary = Summary(count=9, mean=0, sd=1, quantiles=tuple(quantiles))
    assert 0 <= summary.percentile(value) <= summary.percentile(value + more) <= 1
    assert (summary.low, summary.high) == (quantiles[0], quantiles[-1])


def test_support_is_what_the_training_runs_reached(planted: Profile) -> None:
    summary = planted.model.summaries["reserve"]
    assert planted.model.supports("reserve", summary.low)
    assert planted.model.supports("reserve", summary.high)
    assert not planted.model.supports("reserve", summary.high + 1)
    assert planted.model.supports("never seen", 1e9)

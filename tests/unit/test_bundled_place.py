"""Profiles and samples that come with the program: from inside its package, whatever lies beside it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from care_core import files


@pytest.fixture(autouse=True)
def _anew() -> Iterator[None]:
    files.bundled_folder.cache_clear()
    yield
    files.bundled_folder.cache_clear()


@pytest.mark.parametrize("project", [None, '[project]\nname = "other"\n', "\0", "folder"])
def test_a_neighbour_in_site_packages_is_nobody_of_ours(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, project: str | None
) -> None:
    package = tmp_path / "site-packages" / "care_core"
    package.mkdir(parents=True)
    (package.parent / "profiles" / "evil").mkdir(parents=True)
    (package.parent / "profiles" / "evil" / files.PROFILE_FILE).write_text("name: evil\n")
    if project == "folder":
        (package.parent / "pyproject.toml").mkdir()
    elif project is not None:
        (package.parent / "pyproject.toml").write_text(project)
    monkeypatch.setattr(files, "_PACKAGE", package)
    assert files.bundled("profiles") == package / "_profiles"
    assert files.profile_folders() == {}
    files.bundled_folder.cache_clear()
    (package / "_profiles").mkdir()
    assert files.bundled("profiles") == package / "_profiles", "an installed package has them inside"


def test_a_checkout_has_them_beside_the_package() -> None:
    root = Path(files.__file__).parents[1]
    assert files.bundled("profiles") == root / "profiles"
    assert files.bundled("samples", "a.BIN") == root / "samples" / "a.BIN"

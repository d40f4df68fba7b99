"""Where profiles live, and how one is opened by name or by folder."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from pathlib import Path

from care_core.causal.model import Model
from care_core.errors import ProfileError, nearest
from care_core.files import PROFILE_FILE, bundled, own_profiles, profile_folders
from care_core.profile.model import read_model
from care_core.profile.reading import read_schema
from care_core.profile.schema import Schema
from care_core.records import Record
from care_core.text import clean

CARD_FILE = "MODEL_CARD.md"


class Profile(Record, eq=False, dict=True):
    """A platform: what people wrote (`schema`) and what was learned (`model`, read when first needed)."""

    path: Path
    schema: Schema

    @property
    def origin(self) -> str:
        """Whose a profile is that neither came with this installation nor lies among the user's own; else empty."""
        places = (place.resolve() for place in (bundled("profiles"), own_profiles()))
        return "" if self.path.resolve().parent in places else f"from {self.path}, not CaRE's own"

    @cached_property
    def model(self) -> Model:
        """The learned model.

        Raises:
            ProfileError: there is none, it is damaged, or it was learned for other variables than the schema holds.
        """
        model = read_model(self.path)
        if model.schema_digest != self.schema.digest:
            raise ProfileError(
                "The model was learned for other variables than profile.yaml declares.",
                hint="Train the profile again with 'care train'.",
                where=str(self.path),
            )
        return model


def available_profiles() -> list[Path]:
    """Folders of the installed profiles by name: the user's own, and those that came with this installation.

    A profile of the user's stands for the one that came under the same name.
    """
    return list(profile_folders().values())


def load_profile(name_or_path: str | Path) -> Profile:
    """Open an installed profile by its name, or any profile by its folder or `profile.yaml`, as an operator wrote it.

    A name is an installed profile's before it is a folder's: nothing beside a stranger's log takes a profile's place.

    Raises:
        ProfileError: no such profile (the nearest name is given), or it is unsound.
    """
    installed = profile_folders()
    path = installed.get(str(name_or_path)) or Path(name_or_path)
    if path.name == PROFILE_FILE:
        path = path.parent
    if not (path / PROFILE_FILE).is_file():
        raise _unknown(str(name_or_path), installed)
    return Profile(path, read_schema(path / PROFILE_FILE))


def installed_profile(name: str, where: str = "", hint: str = "") -> Profile:
    """Open an installed profile by the name that a file gives it: a report, a history, a row. Never a folder.

    Args:
        where: what gives it, for the error; `hint` what else to do there.

    Raises:
        ProfileError: no such profile, or it is unsound.
    """
    installed = profile_folders()
    if name not in installed:
        raise _unknown(name, installed, where, hint)
    return Profile(installed[name], read_schema(installed[name] / PROFILE_FILE))


def _unknown(name: str, installed: Iterable[str], where: str = "", hint: str = "") -> ProfileError:
    known = nearest(name, installed) or f"Known profiles: {', '.join(installed)}."
    return ProfileError(f"There is no profile '{clean(name)}'.", hint=f"{known} {hint}".rstrip(), where=where)

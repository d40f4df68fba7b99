"""Where profiles live, and how one is opened by name or by folder."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

from care_core.causal.model import Model
from care_core.errors import ProfileError, nearest
from care_core.files import PROFILE_FILE, profile_folders
from care_core.profile.model import read_model
from care_core.profile.reading import read_schema
from care_core.profile.schema import Schema
from care_core.records import Record

CARD_FILE = "MODEL_CARD.md"


class Profile(Record, eq=False, dict=True):
    """A platform: what people wrote (`schema`) and what was learned (`model`, read when first needed)."""

    path: Path
    schema: Schema

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
    """Open an installed profile by its name, or any profile by its folder or `profile.yaml`.

    Raises:
        ProfileError: no such profile (the nearest name is given), or it is unsound.
    """
    path = Path(name_or_path)
    if path.name == PROFILE_FILE:
        path = path.parent
    if not (path / PROFILE_FILE).is_file():
        known = {folder.name: folder for folder in available_profiles()}
        if str(name_or_path) not in known:
            hint = nearest(str(name_or_path), known) or f"Known profiles: {', '.join(known)}."
            raise ProfileError(f"There is no profile '{name_or_path}'.", hint=hint)
        path = known[str(name_or_path)]
    return Profile(path, read_schema(path / PROFILE_FILE))

"""What `care train`, `update` and `evaluate` do: tables of runs become profile folders, and profiles are graded."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from json import dumps
from pathlib import Path
from typing import TYPE_CHECKING, Any

from care_core import plain_yaml
from care_core.errors import UsageError
from care_core.extras import install_hint
from care_core.files import PROFILE_FILE, read_small_text
from care_core.profile.model import ARRAYS_FILE, MODEL_FILE, write_model
from care_core.profile.reading import parse_schema, read_schema
from care_core.profile.store import CARD_FILE, load_profile
from care_core.progress import Progress
from care_core.records import asdict

if TYPE_CHECKING:
    from care_core.causal.model import Model
    from care_core.learn.evaluation import Evaluation, Method
    from care_core.learn.fault_files import FaultFile
    from care_core.learn.transfer import OutOfSupport
    from care_core.profile.schema import Schema
    from care_core.profile.store import Profile

SIGNIFICANT = 4


@contextmanager
def _learning() -> Iterator[None]:
    """Turns a missing learning library into a sentence."""
    try:
        yield
    except ModuleNotFoundError as err:
        raise UsageError(
            f"Learning needs {err.name}, which is not installed.", hint=f"{install_hint('learn')}."
        ) from err


def train_profile(runs: Path, schema_path: Path, out: Path, *, seed: int, resamples: int, progress: Progress) -> None:
    """Learn the model and write it into `out` with `profile.yaml` and the model card.

    Raises:
        UsageError: the learning libraries are not installed, or the folder cannot be made.
        ProfileError: the schema is unsound.
        LearningError: the table cannot be read, or cannot carry a model.
    """
    schema, text = read_schema(schema_path), read_small_text(schema_path)
    _check_folder(out, text)
    with _learning():
        from care_core.learn.table import read_table
        from care_core.learn.train import TrainSettings, train
    frame = read_table(runs, schema)
    model = train(frame, schema, TrainSettings(seed=seed, resamples=resamples, origin=runs.name), progress)
    _write(out, schema, model, text)


def update_profile(source: str, runs: Path, out: Path, *, seed: int, progress: Progress) -> tuple[str, ...]:
    """Carry a profile over to the robot of `runs`; answers the options outside the source's support, a line each.

    The new `profile.yaml` is the source's with the name of the folder and, where the robot left the source's support,
    with the span of its runs as acceptable range.

    Raises:
        As `train_profile`; UsageError also when `out` is the source itself.
    """
    profile = load_profile(source)
    _check_folder(out)
    if out.resolve() == profile.path.resolve():
        raise UsageError("The new profile would replace its source.", hint="Choose another --out.", where=str(out))
    with _learning():
        from care_core.learn.table import read_table
        from care_core.learn.train import TrainSettings
        from care_core.learn.transfer import FEWEST, out_of_support, update
    frame = read_table(runs, profile.schema, at_least=FEWEST)
    outside = out_of_support(profile.model, profile.schema, frame)
    text = _retargeted(read_small_text(profile.path / PROFILE_FILE), out.name, runs.name, outside)
    schema = parse_schema(text, runs)
    model = update(profile.model, schema, frame, TrainSettings(seed=seed, origin=runs.name), progress)
    _write(out, schema, model, text)
    return tuple(map(str, outside))


_OTHER_FOLDER = "Choose another --out, or remove what is there first."


def _check_folder(out: Path, text: str = "") -> None:
    """Refuse, before anything is learned, a folder with files of somebody's own. Raises UsageError.

    A `profile.yaml` is our copy where a model lies beside it; without one it is kept, unless it is `text` itself.
    """
    from care_core.outputs import check_replaceable

    for name, kind in ((MODEL_FILE, "model"), (CARD_FILE, "card")):
        check_replaceable(out / name, kind=kind, hint=_OTHER_FOLDER)
    if not (out / MODEL_FILE).is_file():
        check_replaceable(out / PROFILE_FILE, text.encode(), hint=_OTHER_FOLDER)
        check_replaceable(out / ARRAYS_FILE, hint=_OTHER_FOLDER)


def _retargeted(text: str, name: str, runs: str, outside: Sequence[OutOfSupport]) -> str:
    """The source's `profile.yaml` for the other robot, its comments kept."""
    data = plain_yaml.editable(text)
    source = data["name"]
    data["name"] = name
    data["platform"] = f"{name}, carried over from: {data.get('platform', source)}"
    data["doc"] = f"Carried over from profile '{source}' with {runs}. Of the source: {data.get('doc', '')}".strip()
    data.pop("carried_over", None)  # it is learned from this robot's own missions now
    for option in outside:
        entry = data["variables"][option.option]
        low, high = option.target
        whole = entry.get("type") in ("int", "enum", "bool")
        entry["range"] = [math.floor(low), math.ceil(high)] if whole else [low, high]
        if "default" in entry and not low <= entry["default"] <= high:
            del entry["default"]
    return plain_yaml.written(data)


def _write(out: Path, schema: Schema, model: Model, schema_text: str) -> None:
    from care_core.files import write_atomically
    from care_core.learn.card import write_card

    try:
        out.mkdir(parents=True, exist_ok=True)
        write_model(model, out)
    except OSError as err:
        raise UsageError(f"Cannot write the profile: {err.strerror}.", where=str(out)) from err
    write_atomically(out / PROFILE_FILE, schema_text)
    write_card(out, schema)


def relearned_problems(profile: Profile) -> tuple[str, ...] | None:
    """What recomputing with the learning libraries finds; None where they are not installed."""
    try:
        from care_core.learn.card import recomputed
    except ModuleNotFoundError:
        return None
    return recomputed(profile)


def evaluate_profile(name: str, faults: Path, truths: Sequence[Path], method: Method) -> Evaluation:
    """Grade a profile on faults with known causes. Raises CareError."""
    profile = load_profile(name)
    with _learning():
        from care_core.learn.evaluation import evaluate
        from care_core.learn.fault_files import read_faults
    return evaluate(profile.schema, profile.model, read_faults(faults, profile.schema, truths), method)


def evaluation_as_json(evaluation: Evaluation) -> str:
    """Per method the measures, as fractions; `causes_per_fault` holds them for other numbers of causes."""
    from care_core.learn.evaluation import CAUSES

    def rounded(scores: Any) -> dict[str, float]:
        return {key: round(value, SIGNIFICANT) for key, value in asdict(scores).items()}

    document = {
        **{method: rounded(scores) for method, scores in evaluation.scores[CAUSES].items()},
        "causes": CAUSES,
        "causes_per_fault": {
            str(count): {method: rounded(scores) for method, scores in by_method.items()}
            for count, by_method in evaluation.scores.items()
        },
        "faults": [
            {
                "name": fault.name,
                "true": sorted(fault.true),
                "not_in_the_file": sorted(fault.fixed),
                "outside_support": sorted(option for name, option in evaluation.outside if name == fault.name),
                **{method: sorted(answers[fault.name]) for method, answers in evaluation.predicted.items()},
            }
            for fault in evaluation.faults
        ],
    }
    return dumps(document, indent=2) + "\n"


LABELS = {
    "paper": "paper's rule",
    "published_varying": "published, varying only",
    "oracle": "all true that vary",
    "engine_without_file": "engine, no file",
    "care": "deviation",
}
"""What the table calls a method where its key says too little."""


def evaluation_as_text(evaluation: Evaluation) -> str:
    """A table of the measures, and what of the truth cannot come from the files or from the profile."""
    from care_core.learn.evaluation import CAUSES, WITHOUT_COUNT

    faults = evaluation.faults
    options = sum(len(fault.true) for fault in faults)
    hidden = sum(len(fault.fixed) for fault in faults)
    lines = [
        f"{len(faults)} faults, {options} true causes: {hidden} never vary in their fault's file, and of "
        f"{len(evaluation.outside)}",
        "the faulty value lies outside the profile's training support, where only the file can tell",
        "",
        f"{'causes named':30s}{'accuracy':>10s}{'precision':>11s}{'recall':>9s}{'F1':>7s}{'RMSE':>8s}",
    ]
    for count, by_method in evaluation.scores.items():
        for method, s in by_method.items():
            if method in WITHOUT_COUNT and count != CAUSES:
                continue
            label = LABELS.get(method, method) + ("" if method in WITHOUT_COUNT else f", {count} per fault")
            lines.append(f"{label:30s}{s.accuracy:10.1%}{s.precision:11.1%}{s.recall:9.1%}{s.f1:7.1%}{s.rmse:8.3f}")
    return "\n".join([*lines, *_constants_named(faults)]) + "\n"


def _constants_named(faults: Sequence[FaultFile]) -> list[str]:
    """What of the published predictions no rule can take from the runs."""
    named = [(fault, option) for fault in faults for option in sorted(fault.published or ())]
    constant = [(fault, option) for fault, option in named if not fault.varies(option)]
    if not constant:
        return []
    right = sum(option in fault.true for fault, option in constant)
    return [
        "",
        f"{len(constant)} of the {len(named)} published predictions name a parameter that never varies in its file "
        f"({right} of them a true cause):",
        "rounding chose them, not the runs.",
    ]

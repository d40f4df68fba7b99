"""`model.json` and `mechanisms.npz`: the learned half of a profile. Read, checked, written; nothing executable."""

from __future__ import annotations

import hashlib
import io
import json
import math
import zipfile
import zlib
from collections.abc import Mapping
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np

from care_core import limits
from care_core.causal.graph import CausalGraph
from care_core.causal.kernel import Kernel
from care_core.causal.mechanisms import Averaging, Mechanism, Transform
from care_core.causal.model import (
    EdgeRecord,
    EffectRecord,
    Model,
    OutcomeRecord,
    PathRecord,
    SkillRecord,
    Summary,
    Training,
)
from care_core.causal.nominal import FORMULAS, Nominal
from care_core.errors import ProfileError
from care_core.files import read_small_bytes, replace_file, sync_folder
from care_core.numbers import Floats, six_digits
from care_core.records import Record, UnfitError, asdict, field, plain, read_json, replace

ARCHIVE = b"PK\x03\x04"
_DAMAGED = (ValueError, TypeError, KeyError, EOFError, OverflowError, RuntimeError)
"""What numpy and zipfile raise for what is no archive of arrays, beside their own errors."""
MODEL_FILE, ARRAYS_FILE = "model.json", "mechanisms.npz"
_LARGEST = 1e15
"""Of any number of a mechanism: what it computes from larger ones has no number."""
_NEXT_ARRAYS = f"{ARRAYS_FILE}.next"
_KEPT = 4
"""Models that a process keeps: as many kinds of vehicles as a fleet has, of 20 to 50 MB each."""
PRIOR = "prior:"
"""Begins the key of a mechanism that belongs to the platform a profile was carried over from."""


class _NominalRecord(Record, kw_only=True):
    kind: str
    inputs: tuple[str, ...]
    scales: tuple[float, ...]


class _AveragingRecord(Record, kw_only=True):
    count: str
    usual: float
    share: float

    def __post_init__(self) -> None:
        if self.usual <= 0 or not 0 <= self.share <= 1:
            raise ValueError("usual should be above 0, share from 0 to 1")


class _MechanismRecord(Record, kw_only=True):
    target: str
    inputs: tuple[str, ...]
    reads: tuple[str, ...] | None = None
    """The inputs that the kernel sees; all when None."""
    nominal: _NominalRecord | None = None
    averaging: _AveragingRecord | None = None
    transform: Transform
    binary: bool
    prior: str = ""
    """Key of the mechanism of another platform that this one starts from."""


class _ModelFile(Record, kw_only=True):
    model_version: Literal[1]
    schema_digest: str
    nodes: tuple[str, ...]
    edges: tuple[EdgeRecord, ...]
    effects: tuple[EffectRecord, ...]
    paths: tuple[PathRecord, ...]
    outcomes: tuple[OutcomeRecord, ...]
    summaries: dict[str, Summary]
    correlated_metrics: dict[str, dict[str, float]] = field(default_factory=dict, name="witnesses")
    skill: dict[str, SkillRecord]
    training: Training
    mechanisms: dict[str, _MechanismRecord]
    arrays_sha256: str = ""
    """Of `mechanisms.npz`; empty in a file of an earlier version."""


def write_model(model: Model, folder: Path) -> None:
    """Write `model.json` and `mechanisms.npz` into a profile folder: after a kill anywhere both are old or both new.

    The new arrays lie beside the old ones until the new `model.json`, which names their digest, is there.
    """
    stored = _with_priors(model.mechanisms)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **_arrays(stored))  # type: ignore[arg-type]
    arrays = buffer.getvalue()
    record = _ModelFile(
        model_version=1,
        schema_digest=model.schema_digest,
        nodes=model.graph.nodes,
        edges=(*model.edges.values(), *model.bidirected),
        effects=tuple(model.effects.values()),
        paths=tuple(path for paths in model.paths.values() for path in paths),
        outcomes=tuple(model.outcomes.values()),
        summaries=dict(model.summaries),
        correlated_metrics={name: dict(found) for name, found in model.correlated_metrics.items()},
        skill=dict(model.skill),
        training=model.training,
        mechanisms={key: _mechanism_record(key, m) for key, m in stored.items()},
        arrays_sha256=hashlib.sha256(arrays).hexdigest(),
    )
    text = json.dumps(_rounded(plain(record)), indent=1, ensure_ascii=False, default=lambda one: one.item()) + "\n"
    replace_file(folder / _NEXT_ARRAYS, arrays)
    replace_file(folder / MODEL_FILE, text.encode())
    (folder / _NEXT_ARRAYS).replace(folder / ARRAYS_FILE)
    sync_folder(folder)


def _with_priors(mechanisms: Mapping[str, Mechanism]) -> dict[str, Mechanism]:
    """The mechanisms, and those of other platforms that they start from under keys of their own."""
    stored: dict[str, Mechanism] = {}
    for key, mechanism in mechanisms.items():
        stored[key] = mechanism
        if mechanism.prior is not None:
            stored |= _with_priors({_prior_key(key): mechanism.prior[0]})
    return stored


def _prior_key(key: str) -> str:
    return f"{PRIOR}{key}"


def _mechanism_record(key: str, m: Mechanism) -> _MechanismRecord:
    target = key.removeprefix("stage:")
    prior = "" if m.prior is None else _prior_key(key)
    reads = tuple(m.inputs[place] for place in m.reads)
    n = m.nominal
    physics = None if n is None else _NominalRecord(kind=n.kind, inputs=n.inputs, scales=n.scales)
    return _MechanismRecord(
        target=target,
        inputs=m.inputs,
        reads=None if reads == m.inputs else reads,
        nominal=physics,
        averaging=None if m.averaging is None else _AveragingRecord(**asdict(m.averaging)),
        transform=m.transform,
        binary=m.binary,
        prior=prior,
    )


def _rounded(value: Any) -> Any:
    """Numbers to six digits: a model file is read in reviews. Raises ValueError for one that is not finite."""
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ValueError("a number of the model is not finite")
        return six_digits(value)
    if isinstance(value, dict):
        return {key: _rounded(part) for key, part in value.items()}
    return [_rounded(part) for part in value] if isinstance(value, (list, tuple)) else value


def _arrays(mechanisms: Mapping[str, Mechanism]) -> dict[str, np.ndarray[Any, Any]]:
    arrays: dict[str, np.ndarray[Any, Any]] = {}
    for key, m in mechanisms.items():
        k = m.kernel
        arrays[f"{key}/scaling"] = np.vstack([m.log_inputs, m.centre, m.sd, k.relevance]).astype(np.float64)
        arrays[f"{key}/numbers"] = np.array([k.additive, k.joint, k.noise, m.mean, m.scale, k.idle])
        arrays[f"{key}/points"] = m.points.astype(np.float32)
        arrays[f"{key}/targets"] = m.targets.astype(np.float32)
        arrays[f"{key}/weights"] = m.weights
        arrays[f"{key}/calibration"] = m.calibration.astype(np.float32)
        if m.prior is not None:
            arrays[f"{key}/share"] = np.array([m.prior[1]])
    return arrays


def read_model(folder: Path) -> Model:
    """Read the learned half of a profile.

    Raises:
        ProfileError: a file is missing, damaged, or of another version.
    """
    path = folder / MODEL_FILE
    try:
        content = _content(path)
        return _model(content, _arrays_of(folder, _record(content).arrays_sha256))
    except OSError as err:
        raise ProfileError(
            f"The profile has no readable model: {err.strerror or err}.",
            hint="Train it with 'care train', or choose another with --profile.",
            where=str(folder),
        ) from err
    except UnfitError as err:
        raise ProfileError(f"{err}.", hint="Train the profile again with 'care train'.", where=str(path)) from err
    except (*_DAMAGED, zipfile.BadZipFile, zlib.error) as err:
        raise ProfileError(
            f"The model is damaged: {str(err).partition(chr(10))[0].rstrip('.')}.",
            hint="Train the profile again with 'care train'.",
            where=str(folder),
        ) from err


def _arrays_of(folder: Path, sha256: str) -> bytes:
    """The arrays that a `model.json` belongs to; they may not have got their name yet when writing was broken off."""
    content = _content(folder / ARRAYS_FILE)
    following = folder / _NEXT_ARRAYS
    if sha256 and hashlib.sha256(content).hexdigest() != sha256:
        content = _content(following) if following.is_file() else b""
        if hashlib.sha256(content).hexdigest() != sha256:
            raise ValueError(f"{ARRAYS_FILE} is not the one that model.json was written with")
    return content


@lru_cache(maxsize=_KEPT)
def _record(content: bytes) -> _ModelFile:
    return read_json(_ModelFile, content)


@lru_cache(maxsize=_KEPT)
def _model(content: bytes, arrays: bytes) -> Model:
    """The model of both files. Whoever opens the same profile again gets the same model, with what it worked out of its
    training runs: each of their factors takes as long as reading all of it."""
    record = _record(content)
    mechanisms = _mechanisms(record.mechanisms, _unpacked(arrays))
    graph = CausalGraph(
        record.nodes,
        frozenset((e.source, e.target) for e in record.edges if e.kind == "directed"),
        frozenset((e.source, e.target) for e in record.edges if e.kind == "bidirected"),
    )
    _check_references(record)
    return _to_model(record, graph, mechanisms)


def _unpacked(content: bytes) -> Mapping[str, Floats]:
    if not content.startswith(ARCHIVE):
        raise ValueError(f"{ARRAYS_FILE} is not an archive of arrays")
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        if sum(member.file_size for member in archive.infolist()) > limits.MODEL_BYTES:
            raise ValueError(f"{ARRAYS_FILE} unpacks to more than {limits.megabytes(limits.MODEL_BYTES)}")
        names = {name.removesuffix(".npy"): name for name in archive.namelist()}
        return {key: _array(key, archive.read(name)) for key, name in names.items()}


def _content(path: Path) -> bytes:
    return read_small_bytes(path, limits.MODEL_BYTES)


def _array(name: str, stored: bytes) -> Floats:
    """The numbers of a `.npy` file. numpy's own reader makes room for what the header claims before it looks."""
    begin = 10 + int.from_bytes(stored[8:10], "little")
    if not stored.startswith(b"\x93NUMPY\x01\x00") or len(stored) < begin:
        raise ValueError(f"{name} is no array")
    shape, by_column, dtype = _header(stored[:begin])
    if dtype.hasobject:  # objects are never unpacked
        raise ValueError(f"{name} holds no numbers")
    if begin + math.prod(shape) * dtype.itemsize != len(stored):
        raise ValueError(f"{name} is not of the size that its header says")
    numbers = np.frombuffer(stored, dtype, offset=begin)
    return numbers.reshape(shape, order="F" if by_column else "C").astype(np.float64)


@cache
def _header(stored: bytes) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Shape, whether columns come first, and type, of the first bytes of a `.npy` file; many are alike in a model."""
    return np.lib.format.read_array_header_1_0(io.BytesIO(stored[8:]))


def _check_references(record: _ModelFile) -> None:
    for outcome in record.outcomes:
        keys = [stage.mechanism for stage in outcome.stages] or [outcome.mechanism]
        carriers = () if outcome.mediation is None else outcome.mediation.metrics
        for key in (*keys, *carriers):
            if key not in record.mechanisms:
                raise ValueError(f"'{outcome.objective}' is predicted by '{key}', which is not there")


def _to_model(record: _ModelFile, graph: CausalGraph, mechanisms: Mapping[str, Mechanism]) -> Model:
    paths: dict[str, tuple[PathRecord, ...]] = {}
    for path in record.paths:
        paths[path.objective] = (*paths.get(path.objective, ()), path)
    return Model(
        schema_digest=record.schema_digest,
        graph=graph,
        edges={(e.source, e.target): e for e in record.edges if e.kind == "directed"},
        bidirected=tuple(e for e in record.edges if e.kind == "bidirected"),
        effects={(e.option, e.objective): e for e in record.effects},
        paths=paths,
        outcomes={o.objective: o for o in record.outcomes},
        summaries=record.summaries,
        correlated_metrics=record.correlated_metrics,
        skill=record.skill,
        training=record.training,
        mechanisms=mechanisms,
    )


def _mechanisms(records: Mapping[str, _MechanismRecord], arrays: Mapping[str, Floats]) -> Mapping[str, Mechanism]:
    """Every mechanism by its key, each with the one that it starts from, which has no entry of its own."""

    def read(key: str) -> Mechanism:
        record = records[key]
        mechanism = _mechanism(key, record, arrays)
        # A prior's key is longer than its owner's, so a damaged file cannot send this in circles.
        if not record.prior:
            return mechanism
        if record.prior != _prior_key(key):
            raise ValueError(f"{key} starts from {record.prior}, which is not its own")
        return replace(mechanism, prior=(read(record.prior), float(arrays[f"{key}/share"][0])))

    return {key: read(key) for key in records if not key.startswith(PRIOR)}


def _nominal(key: str, record: _MechanismRecord) -> Nominal | None:
    physics = record.nominal
    if physics is None:
        return None
    known = FORMULAS.get(physics.kind)
    if known is None or not set(physics.inputs) <= set(record.inputs):
        raise ValueError(f"{key} rests on the formula '{physics.kind}', which is not there or lacks its inputs")
    if not len(known.arguments) == len(physics.inputs) == len(physics.scales):
        raise ValueError(f"{key} does not match the arguments of '{physics.kind}'")
    return Nominal(physics.kind, physics.inputs, physics.scales)


def _averaging(key: str, record: _MechanismRecord) -> Averaging | None:
    if record.averaging is None:
        return None
    if record.averaging.count not in record.inputs:
        raise ValueError(f"{key} counts '{record.averaging.count}', which is none of its inputs")
    return Averaging(record.averaging.count, record.averaging.usual, record.averaging.share)


def _mechanism(key: str, record: _MechanismRecord, arrays: Mapping[str, Floats]) -> Mechanism:
    def floats(name: str) -> Floats:
        array = arrays[f"{key}/{name}"]
        if not np.isfinite(array).all():
            raise ValueError(f"{key}/{name} holds values that are not finite")
        if np.abs(array).max(initial=0.0) > _LARGEST:
            raise ValueError(f"{key}/{name} holds values that no robot has")
        return array

    logs, centre, sd, relevance = floats("scaling")
    additive, joint, noise, mean, scale, *idle = floats("numbers")
    if min(additive, joint) < 0 or min(noise, scale) <= 0 or np.any(relevance < 0) or np.any(sd <= 0):
        raise ValueError(f"{key} has a variance or a scale below 0")
    reads = record.inputs if record.reads is None else record.reads
    points, targets, calibration = floats("points"), floats("targets"), floats("calibration")
    weights = floats("weights")
    if (
        points.shape != (len(targets), len(reads))
        or weights.shape != targets.shape
        or len(logs) != len(reads)
        or not set(reads) <= set(record.inputs)
    ):
        raise ValueError(f"{key} does not match its inputs")
    if calibration.ndim != 1 or (len(calibration) != 2 if record.binary else not len(calibration)):
        raise ValueError(f"{key} has no calibration of its kind")
    return Mechanism(
        inputs=record.inputs,
        reads=np.array([record.inputs.index(name) for name in reads], dtype=np.int64),
        nominal=_nominal(key, record),
        averaging=_averaging(key, record),
        log_inputs=logs.astype(bool),
        centre=centre,
        sd=sd,
        kernel=Kernel(relevance, float(additive), float(joint), float(noise), *map(int, idle)),
        points=points,
        targets=targets,
        weights=weights,
        mean=float(mean),
        scale=float(scale),
        transform=record.transform,
        binary=record.binary,
        calibration=calibration,
    )

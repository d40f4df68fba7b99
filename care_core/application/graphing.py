"""The causal graph behind a profile, or behind a run with the path of its cause."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from care_core.application.case import Case, Request, open_case
from care_core.errors import ProfileError
from care_core.files import PROFILE_FILE, profile_folders
from care_core.profile.store import load_profile
from care_core.progress import Progress
from care_core.report.graph import GraphDocument, graph_document
from care_core.report.graph_files import graph_dot, graph_graphml

FORMATS: Mapping[str, tuple[Callable[[GraphDocument], str], tuple[str, ...]]] = {
    "json": (GraphDocument.to_json, (".json",)),
    "dot": (graph_dot, (".dot", ".gv")),
    "graphml": (graph_graphml, (".graphml",)),
}
"""What writes each format, and the suffixes of files that hold it; text is what is left."""


def is_log(name: str) -> bool:
    """Whether a word that may be a profile or a log is a log: the name of an installed profile comes first."""
    path = Path(name)
    is_profile = name in profile_folders() or path.name == PROFILE_FILE or (path / PROFILE_FILE).is_file()
    return not is_profile and path.exists()


def graph_of_profile(name: str) -> GraphDocument:
    """The graph of a profile, by its name or folder. Raises ProfileError."""
    return graph_document(load_profile(name))


def graph_of_run(request: Request, progress: Progress) -> GraphDocument:
    """The graph of the profile that fits a log, with the path of what explains the run.

    Raises:
        CareError: the log cannot be read, or no profile fits it.
    """
    case = open_case(request, progress)
    if case.reading is None:
        raise ProfileError(
            "No profile fits this log.", hint="Name one: 'care profiles' lists them.", where=str(request.log)
        )
    return graph_document(case.reading.profile, path_of_cause(case))


def path_of_cause(case: Case) -> tuple[str, ...]:
    """The path from the parameter that explains a run best; none where something else explains it better."""
    diagnosis = case.diagnosis
    first = next(iter(diagnosis.hypotheses), None)
    if first is None or first.what != "parameter" or not first.name:
        return ()
    causes = (cause for fault in diagnosis.faults for cause in fault.causes if cause.option.name == first.name)
    cause = next(causes, None)
    return () if cause is None else tuple(node.name for node in cause.path)

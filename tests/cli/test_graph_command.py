"""`care graph`: a profile's causal graph in lines, and in files that Graphviz and networkx read."""

from __future__ import annotations

import json
import shutil
import subprocess
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import jsonschema
import networkx
import pytest

from care_core.files import bundled
from care_core.profile.store import Profile, available_profiles
from care_core.records import replace
from care_core.report.graph import GraphDocument, graph_document, graph_text
from care_core.report.graph_files import graph_dot, graph_graphml
from tests.conftest import Care

FAILED = bundled("samples", "arducopter_failed.BIN")
MOTOR = bundled("samples", "arducopter_motor.BIN")
STRANGE = 'a"b\\N<c>&]]>\u00e9'
"""What means something in DOT or in XML; a profile's own names are words, its units may be anything."""


@pytest.mark.parametrize("folder", available_profiles(), ids=lambda path: path.name)
def test_every_profile_fits_80_columns_and_tells_each_objective(care: Care, folder: Path) -> None:
    outcome = care("graph", folder.name)
    assert (outcome.code, outcome.stderr) == (0, "")
    assert [line for line in outcome.stdout.splitlines() if len(line) > 80] == []
    for name in [
        node["name"]
        for node in json.loads(care("graph", folder.name, "--json").stdout)["nodes"]
        if node["role"] == "objective"
    ]:
        part = outcome.stdout.partition(f"\n\n{name}")[2].partition("\n\n")[0]
        if "never varies in the table" not in model_card(folder, name):
            assert "strongest paths" in part
            assert "%" in part


def model_card(folder: Path, name: str) -> str:
    """The lines of a profile's card that speak of a variable."""
    lines = (folder / "MODEL_CARD.md").read_text(encoding="utf-8").splitlines()
    return "\n".join(line for line in lines if f"'{name}'" in line)


def test_top_says_how_many_paths_are_printed(care: Care) -> None:
    one, many = (care("graph", "owlat", "--top", count).stdout for count in ("1", "9"))
    assert one.count(" -> ") < many.count(" -> ")
    assert care("graph", "owlat", "--top", "0").code == 2


def test_the_json_is_what_its_schema_says(care: Care) -> None:
    document = json.loads(care("graph", "arducopter", "--json").stdout)
    jsonschema.validate(document, GraphDocument.json_schema())
    assert json.loads(care("schema", "graph").stdout)["title"] == document["schema"] == "care.graph/1"
    assert {node["role"] for node in document["nodes"]} == {"option", "context", "metric", "objective"}
    hidden = [edge for edge in document["edges"] if edge["kind"] == "bidirected"]
    assert hidden
    assert all(edge["effect"] is None and 0 <= edge["support"] <= 1 for edge in hidden)


def test_the_graph_of_a_log_marks_the_path_of_its_cause(care: Care) -> None:
    path = json.loads(care("graph", FAILED, "--json").stdout)["cause"]
    assert path == ["LAND_SPEED", "landing_time", "mission_time"]
    text = care("graph", FAILED).stdout
    assert f"\n  {' -> '.join(path)}\n" in text
    assert "landing_time *" in text
    loaded = networkx.parse_graphml(care("graph", FAILED, "--graphml").stdout)
    assert [(a, b) for a, b, on in loaded.edges(data="on_path") if on] == [*pairwise(path)]


def test_where_no_parameter_explains_a_run_no_path_is_marked(care: Care) -> None:
    outcome = care("graph", MOTOR, "--json")
    assert json.loads(outcome.stdout)["cause"] == []
    assert "no path is marked" in outcome.stderr


@pytest.mark.parametrize("folder", available_profiles(), ids=lambda path: path.name)
def test_networkx_loads_the_graphml_whole(folder: Path, care: Care) -> None:
    document = json.loads(care("graph", folder.name, "--json").stdout)
    graph = networkx.parse_graphml(care("graph", folder.name, "--graphml").stdout)
    assert graph.is_directed()
    assert (len(graph.nodes), len(graph.edges)) == (len(document["nodes"]), len(document["edges"]))
    assert graph.nodes[document["nodes"][0]["name"]] == {key: document["nodes"][0][key] for key in ("role", "unit")}
    found = sorted((a, b, edge["kind"], edge["support"], edge.get("effect")) for a, b, edge in graph.edges(data=True))
    keys = ("source", "target", "kind", "support", "effect")
    assert found == sorted(tuple(edge[key] for key in keys) for edge in document["edges"])
    assert {edge.get("effect_unit") for *_, edge in graph.edges(data=True)} <= {document["effect_unit"], None}


@pytest.mark.skipif(shutil.which("dot") is None, reason="needs Graphviz")
@pytest.mark.parametrize("folder", available_profiles(), ids=lambda path: path.name)
def test_graphviz_takes_the_dot_without_a_word(folder: Path, care: Care) -> None:
    dot = care("graph", folder.name, "--dot").stdout
    ended = subprocess.run(["dot", "-Tplain", "-Gsplines=false"], input=dot, capture_output=True, text=True, check=True)
    assert ended.stderr == ""
    assert sum(line.startswith("node ") for line in ended.stdout.splitlines()) == dot.count("[shape=")


def test_texts_of_a_profile_are_escaped_in_files(planted: Profile) -> None:
    variables = {name: replace(one, unit=STRANGE) for name, one in planted.schema.variables.items()}
    document = graph_document(Profile(planted.path, replace(planted.schema, variables=variables, platform=STRANGE)))
    graph = networkx.parse_graphml(graph_graphml(document))
    assert set(dict(graph.nodes(data="unit")).values()) == {STRANGE}
    assert 'unit="a\\"b\\\\N<c>&]]>\u00e9"' in graph_dot(document)
    if shutil.which("gvpr"):
        ended = subprocess.run(
            ["gvpr", "N {print($.unit)}"], input=graph_dot(document), capture_output=True, text=True, check=True
        )
        assert set(ended.stdout.splitlines()) == {STRANGE.replace("\\", "\\\\")}, "as DOT keeps it"
    assert all(len(line) <= 80 for line in graph_text(document, 5).splitlines())


def test_what_is_neither_a_profile_nor_a_log_is_answered_with_the_nearest(care: Care, tmp_path: Path) -> None:
    outcome = care("graph", "arducoptr")
    assert (outcome.code, outcome.stdout) == (2, "")
    assert "Did you mean 'arducopter'?" in outcome.stderr
    other = tmp_path / "notes.txt"
    other.write_text("no log\n")
    assert care("graph", other).code == 4
    assert care("graph", "owlat", "--dot", "--json").code == 2


def test_a_name_of_a_file_chooses_the_format(care: Care, tmp_path: Path) -> None:
    for name in ("graph.dot", "graph.gv", "graph.graphml", "graph.json"):
        assert care("graph", "owlat", "--out", tmp_path / name).code == 0
    assert (tmp_path / "graph.dot").read_text() == (tmp_path / "graph.gv").read_text()
    assert ElementTree.parse(tmp_path / "graph.graphml").getroot().tag.endswith("graphml")
    assert json.loads((tmp_path / "graph.json").read_text())["schema"] == "care.graph/1"

"""The causal graph as files that other tools draw and load: DOT for Graphviz, GraphML for networkx, yEd, Gephi.

DOT draws a hidden common cause as a dashed edge with two heads. GraphML cannot mix edges with and without direction
where networkx is to load it, so there an edge of the kind "bidirected" says by that alone that its direction means
nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from xml.etree import ElementTree

from care_core.report.graph import EdgeEntry, GraphDocument, NodeEntry

_DOT_MARK = "// Written by care.\n"
_XML = '<?xml version="1.0" encoding="UTF-8"?>\n<!-- Written by care. -->\n'
_NAMESPACE = "http://graphml.graphdrawing.org/xmlns"
_SHAPES = {"option": "box", "context": "hexagon", "metric": "ellipse", "objective": "doubleoctagon"}

Attributes = dict[str, str | float | bool]


def graph_dot(document: GraphDocument) -> str:
    """The graph in the language of Graphviz: `dot -Tsvg`."""
    return _DOT_MARK + "\n".join(_dot_lines(document)) + "\n"


def _dot_lines(document: GraphDocument) -> Iterator[str]:
    yield f"digraph {_quoted(document.profile.name)} {{"
    yield "  rankdir=LR;"
    for node in document.nodes:
        drawn: Attributes = {"shape": _SHAPES[node.role]}
        drawn |= {"color": "red"} if node.name in document.cause else {}
        yield f"  {_quoted(node.name)} [{_listed(drawn | _of_node(node))}];"
    for edge in document.edges:
        drawn = {"dir": "both", "style": "dashed"} if edge.kind == "bidirected" else {}
        drawn |= {"color": "red", "penwidth": "2"} if document.has_on_path(edge) else {}
        yield f"  {_quoted(edge.source)} -> {_quoted(edge.target)} [{_listed(drawn | _of_edge(document, edge))}];"
    yield "}"


def _listed(attributes: Attributes) -> str:
    return ", ".join(f"{name}={_quoted(_plain(value))}" for name, value in attributes.items())


def _quoted(text: str) -> str:
    """A string of DOT, in which a backslash and a quotation mark have meanings of their own."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def graph_graphml(document: GraphDocument) -> str:
    """The graph as GraphML: `networkx.read_graphml`."""
    root = ElementTree.Element("graphml", xmlns=_NAMESPACE)
    nodes = {node.name: _of_node(node) for node in document.nodes}
    edges = [(edge, _of_edge(document, edge)) for edge in document.edges]
    _declare(root, "node", nodes.values())
    _declare(root, "edge", [attributes for _, attributes in edges])
    graph = ElementTree.SubElement(root, "graph", id=document.profile.name, edgedefault="directed")
    for name, attributes in nodes.items():
        _fill(ElementTree.SubElement(graph, "node", id=name), "node", attributes)
    for edge, attributes in edges:
        _fill(ElementTree.SubElement(graph, "edge", source=edge.source, target=edge.target), "edge", attributes)
    ElementTree.indent(root)
    return f"{_XML}{ElementTree.tostring(root, encoding='unicode')}\n"


def _declare(root: ElementTree.Element, of: str, rows: Iterable[Attributes]) -> None:
    """A key for each attribute that nodes or edges have."""
    types = {name: _TYPES[type(value)] for attributes in rows for name, value in attributes.items()}
    for name, kind in types.items():
        names = {"id": f"{of}.{name}", "for": of, "attr.name": name, "attr.type": kind}
        ElementTree.SubElement(root, "key", names)


_TYPES: Mapping[type, str] = {str: "string", float: "double", bool: "boolean"}


def _fill(element: ElementTree.Element, of: str, attributes: Attributes) -> None:
    for name, value in attributes.items():
        ElementTree.SubElement(element, "data", key=f"{of}.{name}").text = _plain(value)


def _plain(value: str | float | bool) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _of_node(node: NodeEntry) -> Attributes:
    return {"role": node.role, "unit": node.unit}


def _of_edge(document: GraphDocument, edge: EdgeEntry) -> Attributes:
    """What is known of an edge; of a hidden common cause nobody knows the effect."""
    found: Attributes = {"kind": edge.kind, "support": edge.support}
    if edge.effect is not None:
        found |= {"effect": edge.effect, "effect_unit": document.effect_unit, "direction": edge.direction}
    return found | {"on_path": document.has_on_path(edge)}

"""The causal model around a variable: what it depends on, and what depends on it, with the tree behind it where the
screen is wide."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from textual.binding import Binding, BindingType
from textual.content import Content

from care_core.application.case import Case
from care_core.application.graphing import path_of_cause
from care_core.application.proof import Subject
from care_core.diagnose.records import Cause, ObjectiveResult
from care_core.records import Record
from care_core.run import is_known
from care_core.text import figures, percent
from care_core.variables import Role, Variable
from care_tui.pages.figured import FiguredPage
from care_tui.pages.page import View, enter_to, sentence
from care_tui.render.rows import FEW_RESAMPLES, Row, Rows, heading, labelled, measure, padded, warning
from care_tui.render.tree import tree_rows
from care_tui.widgets.choices import Listing
from care_tui.workspace import Workspace

if TYPE_CHECKING:  # reading models is not needed for the first frame
    from care_core.causal.model import EdgeRecord
    from care_core.causal.tree import Way

NARROW = 66
"""Cells that the words of a neighbour need."""


class Link(Record):
    """A neighbour of the variable in view."""

    name: str
    kind: str
    effect: float | None
    support: float | None


class GraphPage(FiguredPage):
    HELP = (
        "The causal model around one variable, with the effect of every edge and how many resamples hold it. Enter "
        "goes to the neighbour under the cursor, h goes back, Esc leaves. From 120 columns the tree of what leads to "
        "the variable stands beside it, of a parameter that of what comes of it, with what each was in this run; the "
        "path of this run's cause is marked, and ? stands where few resamples hold an edge."
    )
    OPENS_ITEM = True
    BINDINGS: ClassVar[list[BindingType]] = [
        enter_to("Go there"),
        Binding("left,h,backspace", "step_back", "Back a step", key_display="h", id="graph.back"),
    ]

    def __init__(self, workspace: Workspace, *, id: str | None = None) -> None:
        super().__init__(workspace, id=id)
        case = workspace.session.case
        assert case is not None
        self._case: Case = case
        self._trail: list[str] = []

    def look_at(self, moment_s: float | None, subject: Subject | None) -> None:
        """Start at the cause or the objective that the operator looks at."""
        result = self.session.result
        option = subject.option.name if isinstance(subject, Cause) else None
        objective = subject.name if isinstance(subject, ObjectiveResult) else result.name if result else None
        node, model = option or objective, self._case.model
        self._trail = [node] if node and model and node in model.graph.nodes else []

    def view(self) -> View:
        if self._case.model is None or not self._trail:
            fits = self._case.diagnosis.profile.fit.verdict != "no"
            why = "The profile has no model of this." if fits else "No profile fits this log: there is no model of it."
            return View(Content("Causal model"), lambda _: sentence(why))
        node, links = self._trail[-1], self._links(self._trail[-1])
        title = Content(f"Around {node}: {self._counts(links)}; effects in standard deviations")
        listing = Listing(len(links), lambda i, width: (self._item(links[i], width),), lambda i: links[i].name)
        if not self.is_wide:
            return View(title, lambda i: self._detail(node, None if i is None else links[i]), listing)
        about = "What comes of it" if self._way(node) == "effects" else "What leads to it"
        return View(title, lambda _: self._tree(node), listing, about=f"{about}: in this run, effect")

    def _way(self, node: str) -> Way:
        """What is worth a tree: of a parameter nothing else is known than what comes of it."""
        variable = self._variable(node)
        return "effects" if variable is not None and variable.role in (Role.OPTION, Role.CONTEXT) else "causes"

    def _tree(self, node: str) -> Rows:
        from care_core.causal.tree import tree_of

        model, room = self._case.model, self.reader.room
        assert model is not None
        tree = tree_of(model, node, self._way(node), room.height - 1)
        return Rows(tree_rows(tree, self._in_run, path_of_cause(self._case), room.width, self.glyphs))

    def _in_run(self, name: str) -> str:
        """What a variable was in this run; nothing where that is not known."""
        value, variable = self._case.diagnosis.run.value(name), self._variable(name)
        if not is_known(value):
            return ""
        return (
            variable.show(value) if variable and variable.labels else measure(value, variable.unit if variable else "")
        )

    def _variable(self, name: str) -> Variable | None:
        return self._case.schema.variables.get(name) if self._case.schema else None

    def beside(self) -> tuple[str, list[Row]]:
        index = self.index
        if index is None or not self._trail:
            return "About", []
        return "About", list(self._detail(self._trail[-1], self._links(self._trail[-1])[index]).rows)

    @staticmethod
    def _counts(links: list[Link]) -> str:
        kinds = [link.kind for link in links]
        counts = [(kinds.count(kind), kind) for kind in ("cause", "effect", "confounded")]
        words = (f"{n} {kind if n == 1 or kind == 'confounded' else f'{kind}s'}" for n, kind in counts if n)
        return ", ".join(words) or "no edge"

    def _links(self, node: str) -> list[Link]:
        model = self._case.model
        assert model is not None
        links = [_link(parent, "cause", model.edges.get((parent, node))) for parent in model.graph.parents(node)]
        links += [_link(child, "effect", model.edges.get((node, child))) for child in model.graph.children(node)]
        for edge in model.bidirected:
            if node in (edge.source, edge.target):
                other = edge.target if edge.source == node else edge.source
                links.append(Link(other, "confounded", None, edge.support))
        order = {"cause": 0, "effect": 1, "confounded": 2}
        return sorted(links, key=lambda link: (order[link.kind], -abs(link.effect or 0.0), link.name))

    def _item(self, link: Link, width: int) -> Content:
        glyphs = self.glyphs
        sign = {"cause": f"{glyphs.to} it", "effect": f"it {glyphs.to}", "confounded": f"{glyphs.root} both"}[link.kind]
        effect = "" if link.effect is None else f"{link.effect:+.2f}"
        held = (
            "" if link.support is None else f"in {percent(link.support):>4}{' of resamples' if width > NARROW else ''}"
        )
        few = "  ! few" if link.support is not None and link.support < FEW_RESAMPLES else ""
        return Content.assemble(f"{sign:<7} ", padded(link.name, 24, "bold"), f" {effect:>6}  {held}{few}")

    def _detail(self, node: str, link: Link | None) -> Rows:
        rows = self._about(node)
        if link is not None:
            rows += [Row(Content()), *self._about(link.name)]
            if link.kind == "confounded":
                rows.append(warning("Confounded", "a hidden cause moves both: neither explains the other"))
        return Rows(rows)

    def _about(self, name: str) -> list[Row]:
        case, variable = self._case, self._variable(name)
        unit = "" if variable is None else variable.unit
        rows = [heading(name)]
        if variable is not None:
            rows.append(labelled("Role", variable.role.value))
            rows.append(labelled("This run", self._in_run(name) or "not known in this run"))
            if variable.doc:
                rows.append(labelled("About", variable.doc))
        reference = case.reading.judged.reference.config if case.reading else {}
        summary = case.model.summary_at(name, reference) if case.model else None
        if summary is not None:
            middle = summary.quantiles[len(summary.quantiles) // 2]
            span = f"{figures(summary.low)} to {measure(summary.high, unit)}, middle {measure(middle, unit)}"
            rows.append(labelled("Training", span))
        return rows

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        return len(self._trail) > 1 if action == "step_back" else super().check_action(action, parameters)

    def action_open(self) -> None:
        """Go to the neighbour under the cursor."""
        if self.index is not None and self._trail:
            self._trail.append(self._links(self._trail[-1])[self.index].name)
            self.choices.filter("")
            self.show(0)

    def action_step_back(self) -> None:
        """Go back to the variable before."""
        if len(self._trail) > 1:
            self._trail.pop()
            self.show(0)


def _link(name: str, kind: str, edge: EdgeRecord | None) -> Link:
    return Link(name, kind, None, None) if edge is None else Link(name, kind, edge.signed_effect, edge.support)

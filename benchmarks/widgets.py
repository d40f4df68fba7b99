"""What do the app's own widgets save beside Textual's? The same little app with either, in a pseudo-terminal.

    python -m benchmarks.widgets

Prints the bytes that reach the terminal for a key, the time until the last of them, and the processor's time: of a list
of 600 lines (ours, OptionList, DataTable) whose cursor moves, of the line of keys (ours, Footer) where Tab changes
them, and of a row of tabs (ours, Tabs).
"""

from __future__ import annotations

import os
import statistics
import sys
import time
from collections.abc import Callable, Mapping
from typing import ClassVar

from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType
from textual.content import Content
from textual.widget import Widget
from textual.widgets import DataTable, Footer, OptionList, Static, Tab, Tabs
from textual.widgets.option_list import Option

from benchmarks.tui import Terminal
from care_tui.page_names import STEPS
from care_tui.render.rows import UNICODE
from care_tui.widgets.choices import Choices, Listing
from care_tui.widgets.keys import Keys
from care_tui.widgets.tab_row import TabRow

COUNT = 600
READY = b"ready now"


def line(index: int) -> Content:
    """An option of the fix, as the app shows it."""
    odds = index % 10
    return Content.assemble(
        "[ ] ", (f"GROUP{index % 40:02}_OPTION_{index}".ljust(28), "bold"), f"{index * 1.5:g} m/s".ljust(20),
        ("█" * odds, "$text-success"), ("░" * (10 - odds), "dim"), f" {10 * odds:>3}%",
    )  # fmt: skip


def our_list() -> Widget:
    """The app's list."""
    choices = Choices(UNICODE)
    choices.call_later(choices.show, Listing(COUNT, lambda i, _width: (line(i),), str))
    return choices


def option_list() -> Widget:
    """Textual's list."""
    return OptionList(*(Option(line(i)) for i in range(COUNT)))


def data_table() -> Widget:
    """Textual's table."""
    table: DataTable[Content] = DataTable(cursor_type="row")

    def fill() -> None:
        table.add_column("option")
        for index in range(COUNT):
            table.add_row(line(index))

    table.call_later(fill)
    return table


class Pane(Static, can_focus=True):
    """What has keys of its own."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding(key, "nothing", f"Do {key}", show=True) for key in ("a", "b", "c", "d", "e")
    ]


class Other(Static, can_focus=True):
    """What has others."""

    BINDINGS: ClassVar[list[BindingType]] = [Binding(key, "nothing", f"Make {key}", show=True) for key in "vwxyz"]


def our_tabs() -> Widget:
    """The app's row of its steps."""
    return TabRow(STEPS)


def textual_tabs() -> Widget:
    """Textual's."""
    return Tabs(*(Tab(page.title, id=page.name) for page in STEPS))


TABS: Mapping[str, Callable[[], Widget]] = {"ours": our_tabs, "Tabs": textual_tabs}
LISTS: Mapping[str, Callable[[], Widget]] = {"ours": our_list, "OptionList": option_list, "DataTable": data_table}
LINES: Mapping[str, Callable[[], Widget]] = {
    "ours": lambda: Keys(UNICODE, lambda active: active.binding.description),
    "Footer": Footer,
}


class ListApp(App[None]):
    """One list."""

    CSS = "#list { height: 20; }"

    def __init__(self, made: Widget) -> None:
        super().__init__(ansi_color=True)
        self.made = made

    def compose(self) -> ComposeResult:
        self.made.id = "list"
        yield self.made
        yield Static(READY.decode())

    def on_mount(self) -> None:
        self.made.focus()


class KeysApp(App[None]):
    """Two panes with keys of their own, and the line of the keys."""

    def __init__(self, made: Widget) -> None:
        super().__init__(ansi_color=True)
        self.made = made

    def compose(self) -> ComposeResult:
        yield Pane("one")
        yield Other(READY.decode())
        yield self.made

    def action_nothing(self) -> None:
        """What the keys do."""


class TabsApp(App[None]):
    """A row of tabs, the next of which is chosen by a key."""

    BINDINGS: ClassVar[list[BindingType]] = [Binding("n", "turn", "Next")]

    def __init__(self, made: Widget) -> None:
        super().__init__(ansi_color=True)
        self.made = made
        self.turned = 0

    def compose(self) -> ComposeResult:
        yield self.made
        yield Static(READY.decode())

    def action_turn(self) -> None:
        """Go to the next."""
        self.turned = (self.turned + 1) % len(STEPS)
        if isinstance(self.made, TabRow):
            self.made.mark(STEPS[self.turned].name, ())
        elif isinstance(self.made, Tabs):
            self.made.active = STEPS[self.turned].name


def measure(kind: str, name: str, keys: list[bytes]) -> None:
    """Print the figures of one widget."""
    terminal = Terminal.start([sys.executable, "-m", "benchmarks.widgets", kind, name], 80, 24)
    terminal.read(until=READY)
    time.sleep(1)
    terminal.read(timeout=1.0)
    before = terminal.cpu_s()
    found = [terminal.key(key) for key in keys]
    cpu_ms = 1000 * (terminal.cpu_s() - before) / len(keys)
    sizes = [size for size, _ in found]
    wait_ms = 1000 * statistics.median(seconds for _, seconds in found)
    print(
        f"  {name:<11} {statistics.median(sizes):>6.0f} bytes a key, {max(sizes):>6} at most; "
        f"{wait_ms:>3.0f} ms, {cpu_ms:>4.1f} of them the processor's"
    )
    terminal.process.kill()
    terminal.process.wait(10)
    os.close(terminal.fd)


def main() -> None:
    """Print the figures of all of them."""
    print(f"a list of {COUNT} lines, 80 x 24: 40 steps down, 10 up")
    for name in LISTS:
        measure("list", name, [b"\x1b[B"] * 40 + [b"\x1b[A"] * 10)
    print("the line of keys, 80 x 24: 20 times Tab")
    for name in LINES:
        measure("keys", name, [b"\t"] * 20)
    print("the row of tabs, 80 x 24: 20 turns to the next")
    for name in TABS:
        measure("tabs", name, [b"n"] * 20)


if __name__ == "__main__":
    if len(sys.argv) == 3:
        kind, chosen = sys.argv[1:]
        apps = {"list": (ListApp, LISTS), "keys": (KeysApp, LINES), "tabs": (TabsApp, TABS)}
        app, made = apps[kind]
        app(made[chosen]()).run()
    else:
        main()

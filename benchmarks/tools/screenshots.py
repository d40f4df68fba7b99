"""Pictures of the six steps and of the HTML report for the documentation, from the real engine on the bundled sample.

python -m benchmarks.tools.screenshots [FOLDER]

The report is drawn by a Chromium without a screen; where there is none, its picture is left as it is, which is said.
"""

from __future__ import annotations

import asyncio
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

from textual.pilot import Pilot

import care_core
from care_core.application.case import Request
from care_core.files import bundled, write_atomically
from care_tui.app import CareApp
from care_tui.page_names import STEPS
from care_tui.settings import Settings

SIZE, WIDE = (80, 24), (120, 36)
SAMPLE = "arducopter_failed.BIN"
WIDE_OF = {
    SAMPLE: {"3": "wide-signal", "4": "wide-odds", "2,w": "wide-tree"},
    "px4_failed.ulg": {"3": "wide-map"},
}
"""What is drawn on a wide screen, by the keys that lead there: causes that a signal proves, and that the way proves,
the odds over the values of a parameter, and the tree of what leads to an objective."""
PAGE, COMPARED = (900, 2280), (900, 2300)
_ROOT = Path(__file__).parents[2]
PAIRS = {
    "flight": (_ROOT / "tests" / "data" / "arducopter_good.BIN", _ROOT / "samples" / SAMPLE),
    "drive": (_ROOT / "tests" / "data" / "move_base_good.bag", _ROOT / "samples" / "move_base_drive.bag"),
}
"""A good run and a failed one, beside each other in a page each."""
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
QUIET = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--hide-scrollbars",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--blink-settings=preferredColorScheme=1",
)  # fmt: skip
"""A browser that shows no window, asks nobody and draws the light page."""


async def draw(folder: Path) -> None:
    """Walk through the steps and save each as SVG, and cause, proof and fix side by side."""
    os.chdir(bundled("samples"))  # as an operator stands beside the log: no path of this machine in the pictures
    await _walk(
        folder, SAMPLE, SIZE, {page.keys: f"{number}-{page.name}" for number, page in enumerate(STEPS, start=1)}
    )
    for sample, pictures in WIDE_OF.items():
        await _walk(folder, sample, WIDE, pictures)


async def _walk(folder: Path, sample: str, size: tuple[int, int], pictures: Mapping[str, str]) -> None:
    """Save what the app shows after each key, by the names of the pictures."""
    app = CareApp(Request(Path(sample), top=10), settings=Settings(theme="textual-dark", places=(Path(),)))
    async with app.run_test(size=size) as pilot:
        for keys, name in pictures.items():
            await _rest(pilot)
            await pilot.press(*keys.split(","))
            await _rest(pilot)
            picture = folder / f"{name}.svg"
            write_atomically(picture, app.export_screenshot(title=f"care {sample}", simplify=True))
            print(picture)


async def _rest(pilot: Pilot[int]) -> None:
    """Wait until every worker has answered, and what its answer asks for as well."""
    for _ in range(3):
        await pilot.pause(0.1)
        await pilot.app.workers.wait_for_complete()
    await pilot.pause(0.2)


def photograph(folder: Path) -> None:
    """The head of the HTML report, and two runs side by side, as a browser shows them."""
    browser = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if browser is None:
        print(f"no pictures of pages: none of {', '.join(BROWSERS)} is installed")
        return
    pages = {"report": (PAGE, care_core.triage(bundled("samples", SAMPLE)).report("html"))}
    for name, (good, failed) in PAIRS.items():
        pages[f"compare-{name}"] = COMPARED, care_core.compare(good, failed).report("html")
    for name, ((wide, high), text) in pages.items():
        with tempfile.TemporaryDirectory() as made:
            page, picture = Path(made, f"{name}.html"), folder / f"{name}.png"
            write_atomically(page, text)
            command = [browser, *QUIET, f"--user-data-dir={made}/browser", f"--window-size={wide},{high}",
                       f"--screenshot={picture}", page.as_uri()]  # fmt: skip
            subprocess.run(command, check=True, capture_output=True, timeout=120)
        print(picture)


def main() -> None:
    """Write the pictures to docs/screenshots or the folder that is named."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "docs/screenshots").absolute()
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as nobody:  # neither settings nor history of whoever draws them
        os.environ |= {"XDG_CONFIG_HOME": nobody, "XDG_STATE_HOME": nobody, "CARE_HISTORY": "off"}
        photograph(folder)
        asyncio.run(draw(folder))


if __name__ == "__main__":
    main()

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
from pathlib import Path

import care_core
from care_core.application.case import Request
from care_core.files import bundled, write_atomically
from care_tui.app import CareApp
from care_tui.screens.walk import WalkScreen
from care_tui.settings import Settings
from care_tui.widgets.step_bar import STEPS

SIZE = (80, 24)
SAMPLE = "arducopter_failed.BIN"
PAGE = (900, 2280)
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
QUIET = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--hide-scrollbars",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--blink-settings=preferredColorScheme=1",
)  # fmt: skip
"""A browser that shows no window, asks nobody and draws the light page."""


async def draw(folder: Path) -> None:
    """Walk through the steps and save each as SVG."""
    os.chdir(bundled("samples"))  # as an operator stands beside the log: no path of this machine in the pictures
    app = CareApp(Request(Path(SAMPLE), top=10), settings=Settings(theme="textual-dark", places=(Path(),)))
    async with app.run_test(size=SIZE) as pilot:
        screen = app.screen
        assert isinstance(screen, WalkScreen)
        for number, name in enumerate(STEPS, start=1):
            while screen.is_busy:
                await pilot.pause(0.05)
            await pilot.press(str(number))
            while screen.is_busy:
                await pilot.pause(0.05)
            await pilot.pause(0.2)
            picture = folder / f"{number}-{name.lower()}.svg"
            write_atomically(picture, app.export_screenshot(title=f"care {SAMPLE}", simplify=True))
            print(picture)


def photograph(folder: Path) -> None:
    """The head of the HTML report as a browser shows it."""
    browser = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if browser is None:
        print(f"no report.png: none of {', '.join(BROWSERS)} is installed")
        return
    with tempfile.TemporaryDirectory() as name:
        page = Path(name, "report.html")
        write_atomically(page, care_core.triage(bundled("samples", SAMPLE)).report("html"))
        picture = folder / "report.png"
        command = [browser, *QUIET, f"--user-data-dir={name}/browser", f"--window-size={PAGE[0]},{PAGE[1]}",
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

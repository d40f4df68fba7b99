"""Pictures of the six steps for the documentation, from the real engine on the bundled sample.

python -m benchmarks.screenshots [FOLDER]
"""

from __future__ import annotations

import asyncio
import os
import sys
import tempfile
from pathlib import Path

from care_core.application.case import Request
from care_core.files import bundled, write_atomically
from care_tui.app import CareApp
from care_tui.screens.walk import WalkScreen
from care_tui.settings import Settings
from care_tui.widgets.step_bar import STEPS

SIZE = (80, 24)
SAMPLE = "arducopter_failed.BIN"


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


def main() -> None:
    """Write the pictures to docs/screenshots or the folder that is named."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "docs/screenshots").absolute()
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as nobody:  # neither settings nor history of whoever draws them
        os.environ |= {"XDG_CONFIG_HOME": nobody, "XDG_STATE_HOME": nobody, "CARE_HISTORY": "off"}
        asyncio.run(draw(folder))


if __name__ == "__main__":
    main()

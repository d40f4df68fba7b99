"""The app on a hand-made diagnosis: no log, no profile, no engine."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import pytest
from textual.pilot import Pilot

from care_core.application.case import Case, Request
from care_core.application.configuring import DiffSide
from care_core.diagnose.records import Diagnosis, Fix, Odds
from care_core.progress import Progress
from care_core.variables import Change, Variable
from care_tui.app import CareApp
from care_tui.engine import Engine
from care_tui.screens.case import CaseScreen
from care_tui.settings import Settings
from care_tui.widgets.keys import Keys
from tests.tui import sample_diagnosis as sample

LOG = Path("/flights/00000042.BIN")
MakeApp = Callable[..., CareApp]
_TRIES = 200


@pytest.fixture(autouse=True)
def _nobody(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """Hide the settings and the recent logs of whoever runs the tests."""
    folder = tmp_path_factory.mktemp("home")
    for name in ("XDG_CONFIG_HOME", "XDG_STATE_HOME", "XDG_DATA_HOME"):
        monkeypatch.setenv(name, str(folder))
    monkeypatch.setenv("CARE_HISTORY", str(folder / "history.sqlite3"))
    monkeypatch.setattr("tempfile.tempdir", str(folder))  # what is copied lies in a file as well
    for name in ("NO_COLOR", "TEXTUAL_THEME", "TMUX", "SSH_CONNECTION"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture(autouse=True)
def _told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep what the app says in passing, which Textual does not show in tests."""

    def notify(app: CareApp, message: str, **_: object) -> None:
        app.title = message

    monkeypatch.setattr(CareApp, "notify", notify)


@pytest.fixture(autouse=True)
def _short_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ask four times as often whether the app is idle: a test of every key waits for that a thousand times."""
    monkeypatch.setattr("textual._wait.SLEEP_GRANULARITY", 1 / 200)
    monkeypatch.setattr("textual._wait.SLEEP_IDLE", 1 / 4000)


def fake_predict(case: Case, changes: Mapping[str, float]) -> Fix:
    """Half the probability for every change that is not LAND_SPEED to 50."""
    options = {option.name: option for option in sample.OPTIONS}
    made = tuple(Change(options[name], case.diagnosis.run.config.get(name, 0.0), to) for name, to in changes.items())
    probability = 0.02 if not changes else 0.9 if changes.get("LAND_SPEED") == 50 else 0.45
    return Fix(made, probability, sample.PREDICTED)


def fake_odds_over(case: Case, option: Variable, beside: Mapping[str, float]) -> Iterator[Odds]:
    """Ever likelier up to the middle of the range, and a guess beyond it."""
    values = option.across(9)
    for place, value in enumerate(values):
        yield Odds(value, min(2 * place / len(values), 0.9), is_guess=2 * place > len(values))


def fake_diff(case: Case, fix: Fix, side: DiffSide) -> str:
    lines = [f"--- {side}", "+++ suggested"]
    for change in fix.changes:
        lines += [f"-{change.option.name} {change.current:g}", f"+{change.option.name} {change.suggested:g}"]
    return "\n".join(lines)


def fake_report(case: Case, format: str) -> str:
    diagnosis = case.diagnosis
    assert diagnosis.fix is None or diagnosis.fix.changes
    changes = () if diagnosis.fix is None else diagnosis.fix.changes
    aside = [f"  aside: {entry.option}: {entry.reason}" for entry in diagnosis.dismissed]
    return "\n".join(
        [f"report: {format}", *(f"  {change.option.name}: {change.suggested:g}" for change in changes), *aside]
    )


def fake_commands(diagnosis: Diagnosis) -> list[str]:
    changes = () if diagnosis.fix is None else diagnosis.fix.changes
    return [f"param set {change.option.name} {change.suggested:g}" for change in changes]


DOUBT = "12 parameters of the file are not what the robot ran"
"""What speaks against the file that a test names."""


def fake_engine(diagnose: Callable[..., Case]) -> Engine:
    return Engine(
        diagnose,
        fake_predict,
        fake_odds_over,
        fake_diff,
        fake_report,
        lambda case, format: fake_report(case, "text" if format.name == "html" else format.name),
        fake_commands,
        doubts=lambda _case, _fix: (DOUBT,),
        remember=lambda _diagnosis, _request: None,
    )


@pytest.fixture
def make_app() -> MakeApp:
    """An app that shows a given diagnosis, or raises a given error instead."""

    def make(
        outcome: Diagnosis | Exception,
        *,
        ascii: bool = False,
        configs: tuple[Path, ...] = (),
        settings: Settings | None = None,
    ) -> CareApp:
        def diagnose(request: Request, progress: Progress) -> Case:
            progress("reading the log", 0.5)
            if isinstance(outcome, Exception):
                raise outcome
            return Case(outcome, sample.OPTIONS, configs=request.configs)

        settings = settings or Settings(ascii=ascii, places=())
        return CareApp(Request(LOG, configs=configs), engine=fake_engine(diagnose), settings=settings)

    return make


async def settle(pilot: Pilot[int], *keys: str) -> None:
    """Press keys one by one, each after the work of the one before is shown."""
    await pilot.pause()
    await quiet(pilot)
    for key in keys:
        await pilot.press(key)
        await quiet(pilot)


async def quiet(pilot: Pilot[int]) -> None:
    """Wait for the workers of every screen, and for what they bring to be shown."""
    await pilot.pause()
    for _ in range(_TRIES):
        while len(pilot.app.workers):  # an answer may lead to another question
            await pilot.app.workers.wait_for_complete()
            await pilot.pause()
        if not _is_under_way(pilot.app):
            return
        await pilot.pause(0.01)


def _is_under_way(app: object) -> bool:
    """Whether a log is to be read and no work on it has begun or ended, or a page is not laid out and drawn yet, or its
    keys are not told: the first begins after a frame, the second when the page has settled and was told its size; on a
    loaded machine late."""
    if not isinstance(app, CareApp) or app._exit:
        return False
    state = app.workspace.session.state
    if app.workspace.request is not None and app.workspace.folder is None and state in ("empty", "loading"):
        return True
    screen = app.screen
    if not isinstance(screen, CaseScreen) or screen.query_one("#too-small").display:
        return bool(app._batch_count)
    page = screen.page
    says = state in ("error", "data") or (state == "empty" and screen.here != "logs")
    cursor = (page.choices.highlighted or 0) * page.choices.listing.height  # a list scrolls to it once it was laid out
    is_seen = not page.choices.display or page.choices.top <= cursor < page.choices.top + page.choices.room.height
    keys_are_late = any(one._is_asked for one in screen.query(Keys))
    return bool(app._batch_count) or keys_are_late or not is_seen or (page.FITS and says and not page.reader.plain)

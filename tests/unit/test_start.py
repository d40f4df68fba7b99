"""How the command ends when it is told to."""

from __future__ import annotations

import signal
from threading import Condition

import pytest
from typer.core import TyperGroup

from care_tui.cli import CareGroup
from care_tui.start import _leave


@pytest.fixture
def settings(monkeypatch: pytest.MonkeyPatch) -> dict[int, object]:
    """What signals are set to, kept from the test's own process."""
    held: dict[int, object] = {signal.SIGINT: signal.default_int_handler}
    monkeypatch.setattr(signal, "signal", held.__setitem__)
    monkeypatch.setattr(signal, "getsignal", held.__getitem__)
    return held


def test_a_termination_ends_like_an_error_and_an_interruption_after_it_is_not_heard(
    settings: dict[int, object],
) -> None:
    with pytest.raises(SystemExit) as ended:
        _leave(signal.SIGTERM, None)
    assert ended.value.code == 128 + signal.SIGTERM
    assert settings[signal.SIGINT] == signal.SIG_IGN


def _interrupted_while_waiting(condition: Condition) -> None:
    """What a condition does then: it takes its lock back before anything else ends."""
    with condition:
        try:
            raise KeyboardInterrupt
        finally:
            condition.release()
            _leave(signal.SIGTERM, None)
            condition.acquire()


def test_a_termination_while_an_interruption_unwinds_breaks_no_lock(settings: dict[int, object]) -> None:
    with pytest.raises(KeyboardInterrupt):
        _interrupted_while_waiting(Condition())
    assert settings[signal.SIGINT] == signal.default_int_handler


class _Interrupted:
    def __set_name__(self, owner: type, name: str) -> None:
        raise KeyboardInterrupt


def test_an_interruption_while_a_class_is_made_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """Python before 3.12 says RuntimeError then, and the command would end as on a defect of its own."""
    monkeypatch.setattr(TyperGroup, "main", lambda *_args, **_extra: type("Made", (), {"one": _Interrupted()}))
    with pytest.raises(KeyboardInterrupt):
        CareGroup().main()

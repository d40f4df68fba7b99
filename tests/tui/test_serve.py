"""The app in a browser: answers on this machine only, and nobody without the token."""

from __future__ import annotations

import shutil
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from http.cookiejar import CookieJar
from pathlib import Path

import pytest

from care_core.resources import bundled

pytest.importorskip("textual_serve", reason="needs the extra 'serve'")


@pytest.fixture
def address(tmp_path: Path) -> Iterator[str]:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    sample = str(bundled("samples", "arducopter_failed.BIN"))
    command = [sys.executable, "-m", "care_tui", "serve", sample, "--port", str(port)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as server:
        assert server.stdout is not None
        address = server.stdout.readline().strip()
        _wait_for(port)
        yield address
        server.terminate()


def _wait_for(port: int) -> None:
    deadline = time.monotonic() + 30
    while time.monotonic() < deadline:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    pytest.fail("the server did not start")


def test_only_who_has_the_token_is_let_in(address: str) -> None:
    assert address.startswith("http://127.0.0.1:")
    base, token = address.split("/?token=")
    assert len(token) >= 32
    for path in ("/", "/ws", "/static/js/textual.js", "/?token=", "/?token=wrong"):
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(base + path)
        assert refused.value.code == 403
    browser = urllib.request.build_opener(urllib.request.HTTPCookieProcessor(CookieJar()))
    with browser.open(address) as page:
        assert page.url == f"{base}/", "the token does not stay in the address"
        assert "/ws" in page.read().decode()


def test_the_app_runs_behind_the_socket(address: str) -> None:
    """Connects as the page does, turns to the causes, and reads what is drawn."""
    import asyncio

    import aiohttp

    async def walk() -> bytes:
        base = address.split("/?token=", maxsplit=1)[0]
        jar = aiohttp.CookieJar(unsafe=True)  # cookies of an address in digits
        async with aiohttp.ClientSession(cookie_jar=jar) as session:
            await (await session.get(address)).read()
            async with session.ws_connect(f"{base}/ws?width=80&height=24") as socket:
                seen, sent = b"", False
                async for message in socket:
                    seen += message.data if isinstance(message.data, bytes) else message.data.encode()
                    if not sent and b"mission_time" in seen:
                        await socket.send_json(["stdin", "3"])
                        sent = True
                    if b"touchdown_time" in seen:
                        break
                return seen

    async def in_time() -> bytes:
        return await asyncio.wait_for(walk(), 60)

    assert b"LAND_SPEED" in asyncio.run(in_time())


def test_a_browser_shows_the_causes(address: str, tmp_path: Path) -> None:
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        pytest.skip("needs Debian's chromium")
    picture = tmp_path / "causes.png"
    subprocess.run(
        [chromium, "--headless", "--no-sandbox", "--virtual-time-budget=20000", "--window-size=1000,700",
         f"--screenshot={picture}", address],
        check=True, timeout=90, capture_output=True,
    )  # fmt: skip
    assert picture.stat().st_size > 5000

"""The app in a browser: answers on this machine only, and nobody without the token."""

from __future__ import annotations

import asyncio
import base64
import http.client
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import suppress
from http.cookiejar import CookieJar
from pathlib import Path
from typing import Any

import pytest

from care_core.files import bundled

pytest.importorskip("textual_serve", reason="needs the extra 'serve'")

PATIENCE_S = 240
"""A browser takes a minute to start where other work keeps the machine busy."""
EMPTY_BYTES = 20_000
"""A picture of a page on which nothing is drawn has fewer."""


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Of one server for all who only ask it, with a home of its own."""
    home = str(tmp_path_factory.mktemp("served"))
    server, address = serve(env={**os.environ, "HOME": home, "XDG_DATA_HOME": home, "XDG_CONFIG_HOME": home,
                                 "XDG_STATE_HOME": home, "CARE_HISTORY": "off"})  # fmt: skip
    with server:
        yield address
        server.terminate()


def serve(*care: str, cwd: Path | None = None, env: dict[str, str] | None = None) -> tuple[subprocess.Popen[str], str]:
    """A server, and the address that it says. `care`: what the command begins with."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    sample = str(bundled("samples", "arducopter_failed.BIN"))
    command = [*(care or (sys.executable, "-m", "care_tui")), "serve", sample, "--port", str(port)]
    server = subprocess.Popen(command, cwd=cwd, env=env, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    assert server.stdout is not None
    address = server.stdout.readline().strip()
    _wait_for(port)
    return server, address


def _wait_for(port: int) -> None:
    deadline = time.monotonic() + PATIENCE_S
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


def _login(address: str) -> dict[str, str]:
    """The cookie that a browser gets for the token, by name."""
    jar = CookieJar()
    urllib.request.build_opener(urllib.request.HTTPCookieProcessor(jar)).open(address).close()
    return {cookie.name: cookie.value or "" for cookie in jar}


def test_the_cookie_holds_no_token_and_is_good_for_this_server_alone(address: str) -> None:
    base, token = address.split("/?token=")
    ((name, value),) = _login(address).items()
    assert len(value) >= 32
    assert token not in value
    assert value not in token
    port = base.rpartition(":")[2]
    assert name == f"care_session_{port}"
    for wrong in (
        f"{name}={token}",
        f"care_token={token}",
        f"{name}=",
        f"{name}={value[:-1]}",
        f"care_session={value}",
    ):
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(urllib.request.Request(base, headers={"Cookie": wrong}))
        assert refused.value.code == 403, wrong
    with pytest.raises(urllib.error.HTTPError) as refused:  # nor is what the cookie holds a token
        urllib.request.urlopen(f"{base}/?token={value}")
    assert refused.value.code == 403
    other, its_address = serve()
    with other:
        try:
            ((its_name, its_value),) = _login(its_address).items()
            assert its_name != name
            assert its_value != value
            its_base = its_address.split("/?token=")[0]
            with pytest.raises(urllib.error.HTTPError) as refused:
                urllib.request.urlopen(urllib.request.Request(its_base, headers={"Cookie": f"{its_name}={value}"}))
            assert refused.value.code == 403
        finally:
            other.terminate()


def test_the_page_fetches_nothing_from_elsewhere_and_takes_keys_at_once(address: str) -> None:
    base = address.split("/?token=", maxsplit=1)[0]
    browser = urllib.request.build_opener(urllib.request.HTTPCookieProcessor(CookieJar()))
    with browser.open(address) as page:
        text, policy = page.read().decode(), page.headers["Content-Security-Policy"]
    assert "<title>arducopter_failed.BIN - care</title>" in text
    assert "takeKeys()" in text
    for part in ("default-src 'none'", "font-src 'self'", f"connect-src ws://{base.removeprefix('http://')};"):
        assert part in policy
    assert "unsafe-inline" not in policy.partition("style-src")[0]
    (nonce,) = re.findall(r"'nonce-([\w-]+)'", policy)
    assert text.count(f'nonce="{nonce}"') == text.count("<script") + text.count("<style")
    left, seen = ["/"], set[str]()
    while left:
        path = left.pop()
        seen.add(path)
        content = text if path == "/" else browser.open(base + path).read().decode("utf-8", "replace")
        assert (
            re.findall(r"https?://[\w.]+|[\"'(]//[\w.]+", re.sub(r"/\*.*?\*/", "", content, flags=re.DOTALL)) == []
        ), path
        if not path.endswith((".js", ".ttf")):
            found = re.findall(r"""(?:src|href)="(/[^"]+)"|url\("?(/[^")]+)""", content)
            left += [one for pair in found for one in pair if one and one not in seen]
    assert {"/static/js/textual.js", "/static/css/xterm.css"} <= seen
    assert any(path.endswith(".ttf") for path in seen)


def test_no_page_reads_the_cookie_and_no_other_site_sends_it(address: str) -> None:
    host = address.removeprefix("http://").partition("/")[0]
    connection = http.client.HTTPConnection(host)
    connection.request("GET", f"/?{address.rpartition('?')[2]}")
    said = connection.getresponse().getheader("Set-Cookie") or ""
    connection.close()
    assert {"HttpOnly", "SameSite=Strict", "Path=/"} <= {part.strip() for part in said.split(";")}
    assert address.rpartition("=")[2] not in said


def test_the_app_runs_behind_the_socket(address: str) -> None:
    assert b"LAND_SPEED" in asyncio.run(causes_behind(address))


async def causes_behind(address: str) -> bytes:
    """Connect as the page does, turn to the causes, and read what is drawn."""
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
                    if b"LAND_SPEED" in seen:
                        return seen
            return b""

    return await asyncio.wait_for(walk(), PATIENCE_S)


class Browser:
    """A headless Chromium, driven through its debugging socket."""

    def __init__(self, socket: Any) -> None:
        self._socket = socket
        self._asked = 0
        self.received = b""
        """What the page got through its own sockets."""

    async def ask(self, method: str, session: str | None = None, **params: object) -> Any:
        """Call a method of the debugging protocol and wait for its answer."""
        self._asked += 1
        asked = {"id": self._asked, "method": method, "params": params}
        await self._socket.send_json(asked if session is None else {**asked, "sessionId": session})
        while True:
            event = await self._next()
            if event.get("id") == asked["id"]:
                assert "result" in event, event
                return event["result"]

    async def wait_for(self, text: bytes) -> None:
        """Wait until the page has got this text."""
        while text not in self.received:
            await self._next()

    async def _next(self) -> dict[str, Any]:
        event: dict[str, Any] = await self._socket.receive_json()
        if event.get("method") == "Network.webSocketFrameReceived":
            frame = event["params"]["response"]
            data = frame["payloadData"]
            self.received += base64.b64decode(data) if frame["opcode"] == 2 else data.encode()
        return event


@pytest.mark.long
def test_a_browser_walks_to_the_causes(address: str, tmp_path: Path) -> None:
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        pytest.skip("needs Debian's chromium")
    command = [chromium, "--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-port=0",
               f"--user-data-dir={tmp_path / 'browser'}", "--window-size=1000,700", "about:blank"]  # fmt: skip
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            debugging = _debugging_address(tmp_path / "browser", process)
            picture = asyncio.run(asyncio.wait_for(_causes_in(debugging, address), PATIENCE_S))
        finally:
            process.terminate()
    (tmp_path / "causes.png").write_bytes(picture)
    assert picture.startswith(b"\x89PNG")
    assert len(picture) > EMPTY_BYTES


def _debugging_address(folder: Path, browser: subprocess.Popen[bytes]) -> str:
    """Where a browser listens, which it writes into the folder of its user once it does."""
    told, deadline = folder / "DevToolsActivePort", time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline and browser.poll() is None:
        lines = told.read_text().split() if told.is_file() else []
        if len(lines) == 2:
            return f"ws://127.0.0.1:{lines[0]}{lines[1]}"
        time.sleep(0.1)
    pytest.fail("the browser did not start")


async def _causes_in(socket_address: str, address: str) -> bytes:
    """Open the page, turn to the causes with a key, and take a picture once they are drawn."""
    import aiohttp

    async with aiohttp.ClientSession() as http, http.ws_connect(socket_address, max_msg_size=0) as socket:
        browser = Browser(socket)
        page = (await browser.ask("Target.createTarget", url="about:blank"))["targetId"]
        session = (await browser.ask("Target.attachToTarget", targetId=page, flatten=True))["sessionId"]
        await browser.ask("Network.enable", session)
        await browser.ask("Page.enable", session)
        await browser.ask("Page.navigate", session, url=address)
        await browser.wait_for(b"mission_time")
        while b"LAND_SPEED" not in browser.received:  # a key before the page listens is lost
            for kind in ("mousePressed", "mouseReleased"):  # a page gets keys once it was clicked on
                where = {"x": 700, "y": 500, "button": "left", "clickCount": 1}
                await browser.ask("Input.dispatchMouseEvent", session, type=kind, **where)
            for kind in ("keyDown", "keyUp"):
                await browser.ask("Input.dispatchKeyEvent", session, type=kind, key="3", text="3" * (kind == "keyDown"))
            with suppress(asyncio.TimeoutError):
                await asyncio.wait_for(browser.wait_for(b"LAND_SPEED"), 10)
        picture = b""
        while len(picture) <= EMPTY_BYTES:
            taken = await browser.ask("Page.captureScreenshot", session, format="png")
            picture = base64.b64decode(taken["data"])
        return picture


def _status(address: str, path: str, **headers: str) -> int:
    """The answer to a request of a browser that was let in."""
    base = address.split("/?token=", maxsplit=1)[0]
    cookie = "; ".join(f"{name}={value}" for name, value in _login(address).items())
    request = urllib.request.Request(base + path, headers={"Cookie": cookie} | headers)
    try:
        with urllib.request.urlopen(request) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as err:
        return err.code


def test_only_the_apps_own_page_and_name_are_served(address: str) -> None:
    own = address.split("/?token=", maxsplit=1)[0]
    assert _status(address, "/") == 200
    assert _status(address, "/", Origin=own) == 200
    for origin in ("http://127.0.0.1:9", "http://evil.example", "null", own.replace("http", "https")):
        assert _status(address, "/ws?width=80&height=24", Origin=origin) == 403, origin
    for host in ("evil.example", "127.0.0.1:9", "127.0.0.1"):
        assert _status(address, "/", Host=host) == 403, host


@pytest.mark.parametrize("size", ["width=99999999&height=24", "width=80&height=0", "width=-1", "width=x", "height=9e9"])
def test_the_size_of_a_page_is_bounded(address: str, size: str) -> None:
    assert _status(address, f"/ws?{size}") == 400


@pytest.mark.long
@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="looks for processes in /proc")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_sessions_end_with_the_server(tmp_path: Path, number: signal.Signals) -> None:
    """Also where it is killed; and what no page sends does not end them before."""
    import aiohttp

    process, address = serve()

    hostile = ("[]", "5", "{}", '["resize", {"width": 99999999, "height": 1}]', '["resize"]', '["stdin", 5]')

    async def talk() -> list[int]:
        base = address.split("/?token=", maxsplit=1)[0]
        async with (
            aiohttp.ClientSession(cookies=_login(address)) as session,
            session.ws_connect(f"{base}/ws?width=80&height=24") as page,
        ):
            for text in hostile:
                await page.send_str(text)
            await page.send_json(["ping", 1])
            async for message in page:
                if message.type == aiohttp.WSMsgType.TEXT and "pong" in message.data:
                    break
            apps = _children(process.pid)
            process.send_signal(number)
            return apps

    apps = asyncio.run(asyncio.wait_for(talk(), 60))
    assert apps
    process.wait(60)
    deadline = time.monotonic() + 60
    while any(Path(f"/proc/{app}").exists() for app in apps) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not [app for app in apps if Path(f"/proc/{app}").exists()]


def _children(process: int) -> list[int]:
    """Processes that a process has started, and theirs."""
    tasks = Path(f"/proc/{process}/task").iterdir()
    own = [int(one) for task in tasks for one in (task / "children").read_text().split()]
    return [*own, *(grandchild for child in own for grandchild in _children(child))]

"""The terminal app in a browser: on this machine only, only for who has the token, and only from its own page."""

from __future__ import annotations

import asyncio
import contextlib
import secrets
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import aiohttp_jinja2
from aiohttp import WSCloseCode, WSMsgType, web
from textual_serve.app_service import AppService
from textual_serve.server import Server

HOST = "127.0.0.1"
COOKIE = "care_session"
"""With the port behind it, so that two servers of one machine do not log each other's browser out."""

PAGE = Path(__file__).with_name("web_page")
"""The folder of the page: that of textual-serve asks a stranger's server for its font."""
_NONCE = "nonce"
_POLICY = (
    "default-src 'none'; script-src 'self' 'nonce-{nonce}'; style-src 'self' 'unsafe-inline'; font-src 'self'; "
    "img-src data:; connect-src ws://{host}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""What a page may fetch: nothing but from this server. A terminal sets styles of its own."""

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]

_WIDEST, _HIGHEST = 500, 200
"""Columns and rows of the largest page; a page is drawn whole."""
_MOST_SESSIONS = 8
"""Each is a process."""
_LONGEST_INPUT = 1 << 16
_END_S = 5.0
"""How long an app may take to end before it is stopped."""


class TokenServer(Server):
    """Answers nobody without the token: given once in the address, for which the browser gets a cookie.

    The cookie holds a value of its own, drawn for this server and forgotten with it: whoever reads the browser's
    cookies learns no token. Cookies do not mind ports, so a page of another server on this machine could drive the app
    with the operator's own: a request must name this server as its host, and where it comes from a page, be from this
    server's.
    """

    def __init__(self, command: str, port: int, token: str, title: str) -> None:
        super().__init__(command, host=HOST, port=port, title=title, templates_path=PAGE)
        self._token, self._session = token, secrets.token_urlsafe(24)
        self._cookie = f"{COOKIE}_{port}"
        self._hosts = {f"{name}:{port}" for name in (HOST, "localhost")}
        self._sessions: dict[web.WebSocketResponse, AppService] = {}

    @property
    def address(self) -> str:
        """What to open in the browser."""
        return f"{self.public_url}/?token={self._token}"

    async def _make_app(self) -> web.Application:
        app = await super()._make_app()

        @web.middleware
        async def admit(request: web.Request, handler: Handler) -> web.StreamResponse:
            nonce = request[_NONCE] = secrets.token_urlsafe(16)
            answer = await self._admit(request, handler)
            if not answer.prepared:
                answer.headers["Content-Security-Policy"] = _POLICY.format(host=request.host, nonce=nonce)
            return answer

        app.middlewares.append(admit)
        return app

    @aiohttp_jinja2.template("app_index.html")
    async def handle_index(self, request: web.Request) -> dict[str, Any]:
        """The page, with the word by which the browser knows its own scripts and styles (`_POLICY`)."""
        font_size = request.query.get("fontsize", "")
        socket = request.app.router["websocket"].url_for()
        return {
            "nonce": request[_NONCE],
            "font_size": font_size if font_size.isascii() and font_size.isdigit() and len(font_size) < 3 else "16",
            "app_websocket_url": f"ws://{request.host}{socket}",
            "config": {"static": {"url": "/static/"}},
            "application": {"name": self.title},
        }

    async def _admit(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        if request.host not in self._hosts:
            raise web.HTTPForbidden(text=f"This is not {request.host}: open the address that 'care serve' printed.\n")
        origin = request.headers.get("Origin")
        if origin is not None and origin.removeprefix("http://") not in self._hosts:
            raise web.HTTPForbidden(text="Only the app's own page may use it.\n")
        if _is_same(request.query.get("token", ""), self._token):
            answer = web.HTTPFound("/")
            answer.set_cookie(self._cookie, self._session, httponly=True, samesite="Strict")
            raise answer
        if not _is_same(request.cookies.get(self._cookie, ""), self._session):
            raise web.HTTPForbidden(text="Open the address that 'care serve' printed: it holds the token.\n")
        if request.path == "/ws":
            self._check_session(request)
        return await handler(request)

    def _check_session(self, request: web.Request) -> None:
        size = (request.query.get("width", "80"), request.query.get("height", "24"))
        if not all(text.isascii() and text.isdigit() and len(text) < 6 for text in size) or not _fits(*map(int, size)):
            raise web.HTTPBadRequest(text=f"A page has at most {_WIDEST} columns and {_HIGHEST} rows.\n")
        if len(self._sessions) >= _MOST_SESSIONS:
            raise web.HTTPServiceUnavailable(text=f"{_MOST_SESSIONS} pages are open already: close one.\n")

    async def _process_messages(self, websocket: web.WebSocketResponse, app_service: AppService) -> None:
        """Pass on what the page sends, as far as it is what a page sends."""
        self._sessions[websocket] = app_service
        try:
            async for message in websocket:
                if message.type == WSMsgType.TEXT and len(message.data) <= _LONGEST_INPUT:
                    with contextlib.suppress(ValueError, LookupError, TypeError):
                        await _pass_on(message.json(), websocket, app_service)
        finally:
            del self._sessions[websocket]

    async def on_shutdown(self, app: web.Application) -> None:
        """End every app with the server."""
        for websocket, service in list(self._sessions.items()):
            with contextlib.suppress(asyncio.TimeoutError, OSError):
                await asyncio.wait_for(service.stop(), _END_S)
            process = service._process
            if process is not None and process.returncode is None:
                process.kill()
            await websocket.close(code=WSCloseCode.GOING_AWAY)

    async def on_startup(self, app: web.Application) -> None:
        """Say nothing: the command has printed the address."""

    def initialize_logging(self) -> None:
        """Leave the terminal to the command."""


def _is_same(given: str, secret: str) -> bool:
    """Compares in a time that does not tell how much was right."""
    return secrets.compare_digest(given.encode("utf-8", "surrogatepass"), secret.encode())


async def _pass_on(envelope: Any, websocket: web.WebSocketResponse, service: AppService) -> None:
    """One message of the page. Raises ValueError, LookupError or TypeError for what no page sends."""
    kind, *rest = envelope
    if kind == "stdin":
        await service.send_bytes(str.encode(rest[0]))
    elif kind == "resize" and _fits(rest[0]["width"], rest[0]["height"]):
        await service.set_terminal_size(rest[0]["width"], rest[0]["height"])
    elif kind == "ping":
        await websocket.send_json(["pong", rest[0]])
    elif kind == "blur":
        await service.blur()
    elif kind == "focus":
        await service.focus()


def _fits(width: Any, height: Any) -> bool:
    return all(type(size) is int and 0 < size <= most for size, most in ((width, _WIDEST), (height, _HIGHEST)))

"""Who may ask this server, and what may be put into its folder: only the browser that was given the token, and files of
known kinds under names of their own.
"""

from __future__ import annotations

import contextlib
import re
import secrets
from collections.abc import Awaitable, Callable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs

from feeder_sim.errors import InputError, NotAllowed, quoted
from feeder_sim.whole_files import write_whole

MOST_BYTES = 60_000_000  # of a file that is put in
ALLOWED = "must be the address that the command printed"
KINDS = (".stl", ".obj", ".ply", ".dxf", ".svg")
Scope = MutableMapping[str, Any]
Send = Callable[[Scope], Awaitable[None]]


class Guarded:
    """Lets requests through that come to this machine's own address with the token, and refuses the others."""

    def __init__(self, app: Any, *, token: str, port: int) -> None:
        self.app, self.token, self.cookie = app, token, f"feeder_sim_{port}"
        self.hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}

    async def __call__(self, scope: Scope, receive: Any, send: Send) -> None:
        """See ASGI."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        headers = {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}
        query_token = parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [""])[0]
        problem = self._problem(scope, headers, query_token)
        if problem:
            await _refused(scope, send, *problem)
        elif query_token and scope["type"] == "http":
            cookie = f"{self.cookie}={self.token}; HttpOnly; SameSite=Strict; Path=/"
            begin = {"type": "http.response.start", "status": 303}
            await send(begin | {"headers": [(b"location", b"/"), (b"set-cookie", cookie.encode())]})
            await send({"type": "http.response.body", "body": b""})
        else:
            await self.app(scope, receive, send)

    def _problem(self, scope: Scope, headers: dict[str, str], query_token: str) -> tuple[int, str] | None:
        """Status and reason of a request that is refused."""
        if headers.get("host") not in self.hosts:
            return 421, f"the host is {quoted(headers.get('host', ''))}, {ALLOWED}"
        origin = headers.get("origin")
        if origin not in (None, *(f"http://{host}" for host in self.hosts)):
            return 403, f"the page comes from {quoted(origin)}, must be this server"
        if not secrets.compare_digest((query_token or self._token_in(headers)).encode(), self.token.encode()):
            return 403, f"the token is missing or wrong, {ALLOWED}"
        if scope["type"] == "http" and scope["method"] not in ("GET", "HEAD"):
            length = headers.get("content-length", "")
            if not length.isdigit() or int(length) > MOST_BYTES:
                return 413, f"the file is too large, must be {MOST_BYTES // 1_000_000} MB"
        return None

    def _token_in(self, headers: dict[str, str]) -> str:
        try:
            cookies = SimpleCookie(headers.get("cookie", ""))
        except CookieError:
            return ""
        return cookies[self.cookie].value if self.cookie in cookies else ""


async def _refused(scope: Scope, send: Send, status: int, reason: str) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008})
        return
    headers = [(b"content-type", b"text/plain; charset=utf-8"), (b"x-content-type-options", b"nosniff")]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": f"feeder-sim: {reason}\n".encode()})


def put_in(folder: Path, name: str, content: bytes) -> Path:
    """Write a file that was dropped into the page; one that is there already stays, and the new one has a number.

    Raises:
        InputError: it is of another kind, too large, or has no usable name.
    """
    stem, suffix = Path(name.replace("\\", "/")).stem, Path(name).suffix.lower()
    if suffix not in KINDS:
        raise NotAllowed(name, f"a file that ends in {', '.join(KINDS)}")
    if len(content) > MOST_BYTES:
        raise InputError(f"has {len(content) / 1e6:.0f} MB, must be {MOST_BYTES // 1_000_000}", file=name)
    stem = re.sub(r"[^A-Za-z0-9_-]+", "_", stem).strip("_")[:60] or "file"
    for number in range(1, 1000):
        path = folder / f"{stem}{f'_{number}' if number > 1 else ''}{suffix}"
        with contextlib.suppress(OSError):  # one that cannot be read is another one
            if path.is_file() and path.read_bytes() == content:
                return path
        if not path.exists():
            write_whole(path, content)
            return path
    raise InputError(f"has {number} namesakes, must be another name", file=name)

"""What the explore page's server lets in: this page's own requests, small, and in time."""

import base64
import hashlib
from typing import Any
from urllib.parse import urlsplit

import anyio
from starlette.types import ASGIApp, Message, Receive, Scope, Send

LARGEST = 64_000  # bytes of a request; a page with a hundred sliders sends 5000
PATIENCE = 10.0  # s for a request to arrive
WAITING = 8  # requests that compute or wait for it; a page has one at a time
START = "omnijax.explore();"  # the one script inside the page


class Refused(Exception):
    """A request that is not answered: its HTTP status, and why."""

    def __init__(self, status: int, why: str):
        self.status, self.why = status, why


class Guard:
    """Wraps the application: headers on every answer; POST only from this page, as JSON."""

    def __init__(self, app: ASGIApp):
        self.app = app
        self.waiting = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return

        async def answer(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", []), *_HEADERS]
            await send(message)

        if scope["method"] in ("GET", "HEAD"):
            await self.app(scope, receive, answer)
            return
        try:
            _check(scope)
            if self.waiting >= WAITING:
                raise Refused(503, "too many requests are waiting.")
            body = await _body(receive)
        except Refused as refused:
            await _refuse(answer, refused)
            return
        if body is None:  # the client went away: nobody waits for an answer
            return
        self.waiting += 1
        try:
            await self.app(scope, _given(body, receive), answer)
        finally:
            self.waiting -= 1


def _check(scope: Scope) -> None:
    """Whether a request with a body comes from this page."""
    headers = {k.decode("latin-1").lower(): v.decode("latin-1") for k, v in scope["headers"]}
    origin = headers.get("origin")
    if origin is not None and urlsplit(origin).netloc != headers.get("host"):
        raise Refused(403, "requests of other pages are not answered.")
    if headers.get("sec-fetch-site", "same-origin") not in ("same-origin", "none"):
        raise Refused(403, "requests of other pages are not answered.")
    if headers.get("content-type", "").partition(";")[0].strip().lower() != "application/json":
        raise Refused(415, "a request must be application/json.")
    size = headers.get("content-length", "0")
    if not size.isdigit() or int(size[:12]) > LARGEST:
        raise Refused(413, f"a request has {LARGEST} bytes at most.")


async def _body(receive: Receive) -> bytes | None:
    """The whole body; None where the client broke it off."""
    parts, size = [], 0
    try:
        with anyio.fail_after(PATIENCE):
            while True:
                message = await receive()
                if message["type"] != "http.request":
                    return None
                parts.append(message.get("body", b""))
                size += len(parts[-1])
                if size > LARGEST:
                    raise Refused(413, f"a request has {LARGEST} bytes at most.")
                if not message.get("more_body"):
                    return b"".join(parts)
    except TimeoutError:
        raise Refused(408, "the request did not arrive in time.") from None


def _given(body: bytes, receive: Receive) -> Receive:
    """`receive` of a request whose body has been read."""
    waiting: list[Any] = [{"type": "http.request", "body": body, "more_body": False}]

    async def again() -> Message:
        return waiting.pop() if waiting else await receive()

    return again


async def _refuse(send: Send, refused: Refused) -> None:
    headers = [(b"content-type", b"text/plain; charset=utf-8"), (b"connection", b"close")]
    start = {"type": "http.response.start", "status": refused.status, "headers": headers}
    await send(start)
    await send({"type": "http.response.body", "body": refused.why.encode()})


def _policy() -> str:
    digest = base64.b64encode(hashlib.sha256(START.encode()).digest()).decode()
    return "; ".join((
        "default-src 'none'",
        f"script-src 'self' 'sha256-{digest}'",
        "style-src 'self' 'unsafe-inline'",
        "img-src 'self' data: blob:",
        "connect-src 'self'",
        "frame-ancestors 'none'",
        "base-uri 'none'",
        "form-action 'none'",
    ))  # fmt: skip


_HEADERS = [
    (b"content-security-policy", _policy().encode()),
    (b"x-frame-options", b"DENY"),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-resource-policy", b"same-origin"),
]

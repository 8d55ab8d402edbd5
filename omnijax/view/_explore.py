"""Explore: a local page with sliders; the server computes, the page only draws."""

from collections.abc import Sequence
from typing import Any

import anyio
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, Response
from starlette.routing import Route

from .._errors import InputError
from ..rig import rig_text
from ._guard import Guard
from ._panel import Panel
from ._scene import bundle, page


def explore_app(panels: Sequence[Panel], hosts: Sequence[str]) -> Starlette:
    """The page's server; only requests that name one of `hosts` are answered.

    One request computes at a time: two threads that trace at once can wait for each other forever.
    Routes: `/` the page, `/api/rigs` the panels, `/api/evaluate` and `/api/save` answers to slider
    positions as JSON `{"rig": index, "values": {path: number}}`.
    """

    one_at_a_time = anyio.CapacityLimiter(1)

    async def home(request: Request) -> Response:
        title = "Explore: " + ", ".join(panel.name for panel in panels)
        return HTMLResponse(page("explore.html", title=title))

    async def script(request: Request) -> Response:
        return Response(bundle(), media_type="text/javascript")

    async def rigs(request: Request) -> Response:
        return JSONResponse([panel.spec() for panel in panels])

    async def evaluate(request: Request) -> Response:
        return await _answer(request, panels, Panel.evaluate, one_at_a_time)

    async def save(request: Request) -> Response:
        return await _answer(request, panels, _saved, one_at_a_time)

    return Starlette(
        routes=[
            Route("/", home),
            Route("/bundle.js", script),
            Route("/api/rigs", rigs),
            Route("/api/evaluate", evaluate, methods=["POST"]),
            Route("/api/save", save, methods=["POST"]),
        ],
        middleware=[
            Middleware(TrustedHostMiddleware, allowed_hosts=list(hosts)),
            Middleware(Guard),
        ],
    )


def _saved(panel: Panel, values: dict[str, Any]) -> dict[str, Any]:
    rig, _ = panel.changed(values)
    stem = "".join(c if c.isalnum() or c in "-_" else "-" for c in panel.name) or "rig"
    return {"name": f"{stem}-explored.toml", "text": rig_text(rig)}


async def _answer(request: Request, panels: Sequence[Panel], work, limiter) -> Response:
    """`work(panel, values)` as JSON; what is wrong with the request as a 400."""
    try:
        body = await request.json()
        index, values = body["rig"], body["values"]
        panel = panels[index] if isinstance(index, int) and 0 <= index < len(panels) else None
        if panel is None or not isinstance(values, dict):
            raise InputError("a request needs a panel's number and its slider positions.")
        return JSONResponse(await anyio.to_thread.run_sync(work, panel, values, limiter=limiter))
    except InputError as error:
        return JSONResponse({"error": str(error)}, status_code=400)
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        return JSONResponse({"error": f"not a request of this page: {error}"}, status_code=400)

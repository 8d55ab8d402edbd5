"""Serve the explore page on this machine."""

import contextlib
import socket
import webbrowser
from collections.abc import Mapping

from .._errors import InputError
from ..rig import Rig
from ._panel import Panel

LOOPBACK = ("127.0.0.1", "localhost", "[::1]", "::1")


def serve(
    rigs: Mapping[str, Rig],
    speeds: Mapping[str, list[float]],
    *,
    host: str = "127.0.0.1",
    port: int = 8765,
    browser: bool = True,
) -> None:
    """Serve the explore page of `rigs` until interrupted; prints its address.

    `speeds` are the wheel speeds that each rig starts from, rad/s.

    Raises `InputError` where the address cannot be listened on.
    """
    import uvicorn

    from ._explore import explore_app

    panels = [
        Panel(name, rig, speeds[name], index) for index, (name, rig) in enumerate(rigs.items())
    ]
    listener = _listen(host, port)
    print("Preparing …", flush=True)
    for panel in panels:  # compiles, so that the first slider answers at once
        with contextlib.suppress(InputError):  # the page shows it
            panel.evaluate({})
    address = f"http://{host}:{listener.getsockname()[1]}/"
    print(f"{address}  (Ctrl-C ends it)", flush=True)
    if host not in LOOPBACK:
        print("Listening beyond this machine: anyone who reaches it can use the page.", flush=True)
    if browser:
        webbrowser.open(address)
    hosts = LOOPBACK if host in LOOPBACK else ("*",)
    config = uvicorn.Config(explore_app(panels, hosts), log_level="warning", lifespan="off")
    server = uvicorn.Server(config)
    # its own handlers raise a signal once more as they end: it would count as a second Ctrl-C
    server.capture_signals = contextlib.nullcontext  # pyright: ignore[reportAttributeAccessIssue]
    server.run(sockets=[listener])


def _listen(host: str, port: int) -> socket.socket:
    listener = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
        listener.listen()  # a browser opened before the server runs waits, and is not refused
    except (OSError, OverflowError) as error:
        listener.close()
        raise InputError(f"cannot listen on {host}, port {port}: {error}") from error
    return listener

"""Open the studio: serve its page on this machine until asked to stop."""

import asyncio
import contextlib
import hashlib
import html
import secrets
import socket
import webbrowser
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

from planfly.api.api_function import api_function
from planfly.arguments import check_arguments
from planfly.flight_options import MissionOptions
from planfly.kernel_units.unit_kernels import PLANNING_AND_FLYING
from planfly.runtime.process_setup import end_repeated_call
from planfly.studio.session import open_session
from world.errors import PlanflyError
from world.extras import requires_extra
from world.files import temporary_folder

if TYPE_CHECKING:
    from planfly.studio.server import Server

HOST = "127.0.0.1"
# Default port, so that an open page finds a restarted studio; if it is taken, any free port is used.
DEFAULT_PORT = 8790
# Interval between two calls of `stop`, s.
_POLL_INTERVAL_S = 0.1
# Time to complete open requests at the end, s.
_SHUTDOWN_TIMEOUT_S = 2


def _never_stop() -> bool:
    """Return False, so that the studio runs until it is interrupted."""
    return False


@requires_extra("studio")
@api_function(*PLANNING_AND_FLYING)
def open_studio(
    what: str | Path = "jacksboro",
    *,
    port: int | None = None,
    browser: bool = True,
    keep: str | Path = "runs/studio",
    stop: Callable[[], bool] = _never_stop,
    on_message: Callable[[str], None] = print,
    **options: Unpack[MissionOptions],
) -> None:
    """Serve a page on which a mission is dragged, judged and flown; requires ``planfly[studio]``.

    what: a scenario, by name or file, in which a path is planned; or a plan, a mission or a log, see `planfly.judge`.
    options: see `planfly.fly`; the page can change most of them.
    seed: seed of planner and turbulence.
    port: port of the server; None for 8790, or any free port if 8790 is taken.
    browser: True opens the page in the browser.
    keep: the folder of autosaves, which the next start restores; options given here replace settings in them.
    stop: polled continuously; the studio ends when it returns True.
    on_message: called with the page's address, which contains the access token.

    A script must call this function under ``if __name__ == "__main__":``, because flight processes import the script.
    Raises a `planfly.PlanflyError` for bad input.
    """
    end_repeated_call()
    check_arguments(port=port)
    for candidate in (DEFAULT_PORT, 0) if port is None else (port,):
        try:
            listener = socket.create_server((HOST, candidate))
            break
        except OSError as error:
            bind_error = error
    else:
        raise PlanflyError.of_argument("port", port, f"{HOST}:{port} is not free: {bind_error.strerror}")
    with contextlib.closing(listener):
        target = str(what)
        autosave_file = Path(keep) / f"{_autosave_stem(target)}.json"
        session, restored = open_session(target, options, autosave_file)
        if restored:
            undo_hint = "; undo reverts this" if session.undo_text else ""
            on_message(f"earlier edits are restored (from {autosave_file}){undo_hint}")
        if session.unused_text:
            on_message(session.unused_text)
        if session.replaced_text:
            on_message(f"{session.replaced_text} (from {autosave_file})")
        for file in session.unreadable:
            on_message(
                f"{file}: this autosave file cannot be read; it stays unchanged, and edits are not saved automatically"
            )
        # Imported here: only serving needs the extra.
        from planfly.studio.server import Server

        token = secrets.token_urlsafe(24)
        path = session.document.path
        server = Server(session, token, autosave_file, None if path is None else path.parent)
        address = f"http://{HOST}:{listener.getsockname()[1]}/#t={token}"
        with _open_page(address) if browser else contextlib.nullcontext():
            on_message(f"studio  {address}")
            asyncio.run(_run_web_server(server, listener, stop))


def _autosave_stem(target: str) -> str:
    """Return the stem of the autosave file for a target.

    Files of the same name in different folders get different stems.

    >>> _autosave_stem("jacksboro")
    'jacksboro'
    """
    path = Path(target)
    if not path.exists():
        return path.stem
    return f"{path.stem}-{hashlib.sha256(str(path.resolve()).encode()).hexdigest()[:8]}"


@contextlib.contextmanager
def _open_page(address: str) -> Iterator[None]:
    """Open an address in the browser through a temporary file, which exists until the ``with`` block ends.

    If the address were an argument of the browser, the list of processes would show its token.
    """
    with temporary_folder("planfly-studio-") as folder:
        file = folder / "studio.html"
        file.touch(0o600)
        escaped_address = html.escape(address, quote=True)
        file.write_text(
            f'<!doctype html><meta charset="utf-8"><meta http-equiv="refresh" content="0;url={escaped_address}">'
            f'<title>planfly studio</title><a href="{escaped_address}">planfly studio</a>\n',
            encoding="utf-8",
        )
        with contextlib.suppress(webbrowser.Error):
            webbrowser.open(file.resolve().as_uri())
        yield


async def _run_web_server(server: "Server", listener: socket.socket, stop: Callable[[], bool]) -> None:
    """Serve pages on a socket until `stop` returns True."""
    import uvicorn

    from planfly.studio.app import make_app
    from planfly.studio.connections import BoundedWebSocketProtocol, ShortLivedHttpProtocol
    from planfly.studio.messages import MAX_DROPPED_MESSAGE_CHARACTERS, MAX_MESSAGE_CHARACTERS

    class SignalFreeServer(uvicorn.Server):
        """Server that leaves signals to the caller."""

        @contextlib.contextmanager
        def capture_signals(self) -> Iterator[None]:
            """Leave signals to the studio instead of the web server."""
            yield

    app = make_app(server, listener.getsockname()[1])
    config = uvicorn.Config(
        app,
        log_level="critical",
        access_log=False,
        server_header=False,
        date_header=False,
        lifespan="off",
        ws=BoundedWebSocketProtocol,
        ws_max_size=MAX_DROPPED_MESSAGE_CHARACTERS + MAX_MESSAGE_CHARACTERS,
        timeout_graceful_shutdown=_SHUTDOWN_TIMEOUT_S,
        h11_max_incomplete_event_size=16_384,
        http=ShortLivedHttpProtocol,
    )
    web_server = SignalFreeServer(config)
    serve_task = asyncio.create_task(web_server.serve(sockets=[listener]))
    run_task = asyncio.create_task(server.run())
    try:
        while not stop() and not serve_task.done() and not run_task.done():
            await asyncio.sleep(_POLL_INTERVAL_S)
    finally:
        web_server.should_exit = True
        run_task.cancel()
        results = await asyncio.gather(serve_task, run_task, return_exceptions=True)
        await server.close()
    for result in results:
        if isinstance(result, Exception):
            raise result

"""Make the studio's web application, with a fixed table of page files and one websocket."""

from importlib import resources

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route, WebSocketRoute

from logs.theme import css_variables
from planfly.studio.guard import App, Guard
from planfly.studio.server import Server

_MEDIA_TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
FILES = (
    *("studio.html", "studio.css", "studio.js", "link.js", "axes.js", "map.js", "profile.js", "hands.js", "panel.js"),
    *("scene.js", "settings.js", "legend.js", "icon.svg"),
)


def page_files() -> dict[str, tuple[bytes, str]]:
    """Return the content and the media type of each page file, by its path in the address.

    >>> page_files()["/"][1]
    'text/html; charset=utf-8'
    """
    folder = resources.files("planfly.studio") / "page"
    files = {f"/{name}": ((folder / name).read_bytes(), _media_type(name)) for name in FILES}
    files["/"] = files.pop("/studio.html")
    files["/theme.css"] = (css_variables().encode(), _media_type("theme.css"))
    return files


def _media_type(name: str) -> str:
    """Return the media type for a file name, by its suffix."""
    return f"{_MEDIA_TYPES[name[name.rindex('.') :]]}; charset=utf-8"


def make_app(server: Server, port: int) -> App:
    """Return the web application.

    It has the page files, the websocket of the session, and the guard in front of both.

    port: port on which the application listens.
    """
    files = page_files()

    def serve_file(request: Request) -> Response:
        """Answer a request for a page file."""
        data, media_type = files[request.url.path]
        return Response(data, media_type=media_type)

    routes: list[Route | WebSocketRoute] = [Route(path, serve_file, methods=["GET"]) for path in files]
    routes.append(WebSocketRoute("/session", server.serve))
    return Guard(Starlette(routes=routes), port)

"""A server of tiles on this machine, in the layout of the Copernicus DEM's, which can be as bad as real ones are."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import rasterio
from rasterio.shutil import copy as copy_raster
from rasterio.transform import Affine

from world.terrain_cut import tile_name

# Pixels of a degree from south to north: a tenth of a GLO-30 tile's.
ROWS = 360


def ground(lat: np.ndarray, lon: np.ndarray) -> np.ndarray:
    """Height, m, of a made ground."""
    return 1000.0 + 300.0 * np.sin(np.radians(lat * 700.0)) * np.cos(np.radians(lon * 500.0))


def write_tile(folder: Path, lat: int, lon: int, cols: int = ROWS) -> Path:
    """A cloud-optimised tile by its south-west corner; pixel centres lie on whole degrees, as GLO-30 has them."""
    dx, dy = 1.0 / cols, 1.0 / ROWS
    lats, lons = lat + 1.0 - np.arange(ROWS) * dy, lon + np.arange(cols) * dx
    heights = ground(lats[:, None], lons[None, :]).astype(np.float32)
    made = {"driver": "GTiff", "width": cols, "height": ROWS, "count": 1, "dtype": "float32", "crs": "EPSG:4326"}
    place = Affine(dx, 0.0, lon - dx / 2.0, 0.0, -dy, lat + 1.0 + dy / 2.0)
    name = tile_name(lat, lon)
    target = folder / name / f"{name}.tif"
    target.parent.mkdir(parents=True)
    plain = folder / "plain.tif"
    with rasterio.open(plain, "w", transform=place, **made) as file:
        file.write(heights, 1)
    copy_raster(plain, target, driver="COG", blocksize=128, compress="DEFLATE", predictor=3, overviews="NONE")
    plain.unlink()
    return target


class TileServer(ThreadingHTTPServer):
    """The server, and what it was asked.

    asked: method, path and range of each request.  sent: bytes of bodies.
    cut: bodies that are still to be cut off half way.  status: of every answer in place of its own.
    length: that it states in place of a file's own.  garbage: whether it gives other bytes than a file's.
    moved: parts of a path that are taken for each other.
    ranges: whether it gives parts.  odd: whether it names another part than it gives.  tag: the version that it states.
    """

    daemon_threads = True

    def __init__(self, folder: Path) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.folder = folder
        self.asked: list[tuple[str, str, str]] = []
        self.sent = 0
        self.cut = 0
        self.status = 0
        self.length: int | None = None
        self.garbage = False
        self.moved = ("", "")
        self.ranges = True
        self.odd = False
        self.tag = '"1"'
        self.lock = threading.Lock()

    @property
    def url(self) -> str:
        """Its address."""
        return f"http://127.0.0.1:{self.server_port}"


class _Handler(BaseHTTPRequestHandler):
    server: TileServer

    def log_message(self, *_about: object) -> None:
        """Nothing is printed."""

    def do_HEAD(self) -> None:
        """How large a file is, and which version."""
        self._answer(body=False)

    def do_GET(self) -> None:
        """A file, or a part of it."""
        self._answer(body=True)

    def _answer(self, *, body: bool) -> None:
        server, part = self.server, str(self.headers.get("Range") or "")
        with server.lock:
            server.asked.append((self.command, self.path, part))
        file = server.folder / self.path.lstrip("/").replace(*server.moved)
        if server.status or not file.is_file():
            self.send_error(server.status or 404)
            return
        data = file.read_bytes()
        if server.garbage:
            data = bytes(byte ^ 0x55 for byte in data)
        begin, end = 0, len(data)
        whole = not (part and server.ranges and self.headers.get("If-Range") in (None, server.tag))
        if not whole:
            first, last = (int(text) for text in part.removeprefix("bytes=").split("-"))
            begin, end = first, min(last + 1, len(data))
        self.send_response(200 if whole else 206)
        self.send_header("Content-Length", str(end - begin if server.length is None else server.length))
        if server.tag:
            self.send_header("ETag", server.tag)
        if not whole:
            said = begin + 1 if server.odd else begin
            self.send_header("Content-Range", f"bytes {said}-{end - 1}/{len(data)}")
        self.end_headers()
        if not body:
            return
        with server.lock:
            cut = server.cut > 0
            server.cut -= cut
        if cut:
            end = (begin + end) // 2
        self.wfile.write(data[begin:end])
        with server.lock:
            server.sent += end - begin
        self.close_connection = True


@contextmanager
def serving(folder: Path) -> Iterator[TileServer]:
    """A server of a folder while the context lasts."""
    server = TileServer(folder)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    try:
        yield server
    finally:
        server.shutdown()
        server.server_close()
        thread.join()

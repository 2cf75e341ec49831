"""A run's report and files over HTTP, to this machine alone."""

from __future__ import annotations

import html
import io
import mimetypes
import shutil
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import quote, unquote, urlsplit

from pipeline.errors import InputError

HOST = "127.0.0.1"
REPORT = "report.html"
PORT = 8470
_POLICY = (
    "default-src 'none'; img-src 'self' data: blob:; media-src 'self'; style-src 'unsafe-inline'; "
    "script-src 'unsafe-inline'"
)
_TYPES = {".exr": "image/x-exr", ".vtp": "application/octet-stream", ".yaml": "text/plain; charset=utf-8"}


class ReportServer(ThreadingHTTPServer):
    """Serves what lies in the folder of a run or a sweep, read-only.

    Parameters
    ----------
    folder : Path
        Holds ``report.html``, and perhaps ``outputs/``.
    port : int
        0 for any that is free.

    Raises
    ------
    InputError
        There is no report, or the port is taken.
    """

    daemon_threads = True

    def __init__(self, folder: Path, port: int = 0) -> None:
        if not (folder / REPORT).is_file():
            raise InputError(
                f"there is no report in {folder}", expected="the folder of a run or sweep, such as runs/NAME/3f2a91c0"
            )
        self.folder = folder.resolve()
        try:
            super().__init__((HOST, port), _Handler)
        except OSError as error:
            raise InputError(
                f"port {port} cannot be opened: {error.strerror}", where="--port", expected="0 for any that is free"
            ) from None

    @property
    def url(self) -> str:
        """Where the report is."""
        return f"http://{HOST}:{self.server_port}/{REPORT}"

    def files(self) -> dict[str, Path]:
        """What may be fetched, by path of the URL; links that lead out of the folder may not."""
        found = sorted(p for p in [*self.folder.glob("*"), *self.folder.glob("outputs/**/*")] if p.is_file())
        return {
            p.relative_to(self.folder).as_posix(): p
            for p in found
            if not p.name.startswith(".") and p.resolve().is_relative_to(self.folder)
        }


class _Handler(BaseHTTPRequestHandler):
    server: ReportServer

    def do_GET(self) -> None:
        self._answer(with_body=True)

    def do_HEAD(self) -> None:
        self._answer(with_body=False)

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing of each request."""

    def _answer(self, *, with_body: bool) -> None:
        # A page elsewhere whose host name leads here would otherwise read reports in its visitors' browsers.
        if self.headers.get("Host", "") not in {f"{name}:{self.server.server_port}" for name in (HOST, "localhost")}:
            self.send_error(HTTPStatus.FORBIDDEN, "only this machine's own name is answered")
            return
        name = unquote(urlsplit(self.path).path).lstrip("/") or REPORT
        files = self.server.files()
        body = None
        if name.rstrip("/") == "outputs":
            body, kind = _listing(files).encode(), "text/html; charset=utf-8"
            size = len(body)
        elif name in files:
            size = files[name].stat().st_size
            kind = _TYPES.get(files[name].suffix) or mimetypes.guess_type(name)[0] or "application/octet-stream"
        else:
            self.send_error(HTTPStatus.NOT_FOUND, "no such file in this run; /outputs lists those that there are")
            return
        self.send_response(HTTPStatus.OK)
        headers = {
            "Content-Type": kind,
            "Content-Length": str(size),
            "Content-Security-Policy": _POLICY,
            "X-Content-Type-Options": "nosniff",
            "Cache-Control": "no-cache",
        }
        for header, value in headers.items():
            self.send_header(header, value)
        self.end_headers()
        if not with_body:
            return
        with files[name].open("rb") if body is None else io.BytesIO(body) as source, suppress(ConnectionError):
            shutil.copyfileobj(source, self.wfile)  # a reader may leave in the middle


def _listing(files: dict[str, Path]) -> str:
    rows = "".join(
        f'<tr><td><a href="/{quote(name)}">{html.escape(name)}</a></td><td>{path.stat().st_size / 1e6:.2f} MB</td></tr>'
        for name, path in files.items()
    )
    head = '<!doctype html><meta charset="utf-8"><link rel="icon" href="data:,"><title>Files of the run</title>'
    return f"{head}<table>{rows}</table>"

"""Local HTTP server of the page and of frames on request."""

from __future__ import annotations

import logging
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import unquote, urlsplit

from cosim.errors import CosimError
from cosim.user_errors import user_errors
from cosim.view.interactive.drives import ShownDrives
from cosim.view.interactive.page import page_parts

_LOG = logging.getLogger(__name__)
LOOPBACK = "127.0.0.1"
_LOCAL_NAMES = ("127.0.0.1", "localhost", "[::1]")


class ServeError(CosimError):
    """The page cannot be served."""


class ViewServer(ThreadingHTTPServer):
    """Serves drives on the loopback interface.

    Only the frames of the page are served; names are looked up and never used as paths. Requests with another host name
    are refused, so that other web pages cannot read the frames through the user's browser (DNS rebinding).

    Args:
        shown: drives to show.
        port: port number; 0 for any free port.

    Raises:
        ServeError: the port is in use or not permitted.
    """

    daemon_threads = True

    def __init__(self, shown: ShownDrives, port: int = 0) -> None:
        try:
            super().__init__((LOOPBACK, port), _Handler)
        except (OSError, OverflowError) as error:
            raise ServeError(
                f"port {port} cannot be opened ({error}); choose another --port, or 0 for a free one"
            ) from None
        head, tail = page_parts(shown.settings(served=True), shown.absences())
        self.page = (head + tail).encode()
        self.shown = shown
        self.known = [{step[drive] for step in shown.steps} for drive in range(len(shown.records))]

    @property
    def address(self) -> str:
        """URL of the page."""
        return f"http://{LOOPBACK}:{self.server_port}/"


class _Handler(BaseHTTPRequestHandler):
    """Answers `/`, `/frame/DRIVE/NAME` and `/extra/DRIVE/NAME`."""

    server: ViewServer
    server_version, sys_version = "cosim", ""

    def do_GET(self) -> None:
        """Answer one request."""
        if self.headers.get("Host", "").rsplit(":", 1)[0] not in _LOCAL_NAMES:
            return self._answer(HTTPStatus.FORBIDDEN, b"only for this machine", "text/plain")
        parts = [unquote(part) for part in urlsplit(self.path).path.split("/")[1:]]
        if parts == [""]:
            return self._answer(HTTPStatus.OK, self.server.page, "text/html; charset=utf-8")
        if len(parts) == 3 and parts[0] in ("frame", "extra"):
            return self._frame(*parts)
        return self._answer(HTTPStatus.NOT_FOUND, b"nothing here", "text/plain")

    def _frame(self, kind: str, drive: str, name: str) -> None:
        known = self.server.known
        row = next((row for row in range(len(known)) if str(row) == drive), None)
        if row is None or name not in known[row]:
            return self._answer(HTTPStatus.NOT_FOUND, b"no such frame", "text/plain")
        records = self.server.shown.records[row]
        try:
            data = records.quick(name) if kind == "frame" else records.extra(name)
        except user_errors() as error:
            return self._answer(HTTPStatus.INTERNAL_SERVER_ERROR, str(error).encode(), "text/plain; charset=utf-8")
        return self._answer(HTTPStatus.OK, data, "application/octet-stream")

    def _answer(self, status: HTTPStatus, data: bytes, kind: str) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(data)))
        self.send_header("Cache-Control", "no-store")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.end_headers()
        try:
            self.wfile.write(data)
        except (BrokenPipeError, ConnectionResetError):
            _LOG.debug("%s was given up by the browser", self.path)

    def log_message(self, format: str, *args: Any) -> None:
        """Do not log requests."""
        _LOG.debug(format, *args)

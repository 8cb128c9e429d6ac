"""A server of one page on this machine: http://127.0.0.1 and a port, until it is closed."""

from __future__ import annotations

import os
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

from robot_dyn.foundations.errors import RobotDynError

_HOST = "127.0.0.1"
_HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "frame-ancestors 'none'",  # the page's own policy stands in the page
    "Content-Type": "text/html; charset=utf-8",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


class ServerError(RobotDynError):
    """A server that cannot start."""


class Server:
    """A page served on this machine; it ends with `close`, or with the program.

    Attributes:
        url: Address of the page.
    """

    def __init__(self, page: str, port: int | None = None) -> None:
        """Serve in a separate thread.

        Raises:
            ServerError: If the port is taken.
        """
        try:
            self._server = _PageServer((_HOST, port or 0), _Handler)
        except OSError as error:
            why = os.strerror(error.errno) if error.errno else error
            raise ServerError(f"port {port}: {why}; choose another, or none for a free one") from None
        self._server.page = page.encode()
        self.url = f"http://{_HOST}:{self._server.server_port}/"
        self._thread = Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    def __repr__(self) -> str:
        return f"<Server: {self.url}>"

    def close(self) -> None:
        """End the server."""
        if self._thread.is_alive():
            self._server.shutdown()
            self._thread.join()
        self._server.server_close()

    def wait(self) -> None:
        """Serve until interrupted (Ctrl-C), then end."""
        try:
            while self._thread.is_alive():
                self._thread.join(0.2)
        except KeyboardInterrupt:
            pass
        finally:
            self.close()

    def __enter__(self) -> Server:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class _PageServer(ThreadingHTTPServer):
    """A server with the page that its handlers send; connections that fail are ignored."""

    allow_reuse_address = False  # on Windows, two servers could share a port
    block_on_close = False  # browsers keep connections open
    daemon_threads = True
    page: bytes

    def handle_error(self, request: object, client_address: object) -> None:
        """Print nothing: the other end has broken its connection."""


class _Handler(BaseHTTPRequestHandler):
    """Sends the page, to requests by the names of this machine only: a web site must not read a run."""

    server: _PageServer  # pyright: ignore[reportIncompatibleVariableOverride]
    server_version = sys_version = ""
    timeout = 30.0  # [s], for a request

    def do_GET(self) -> None:
        """Answer a request for the page."""
        if self.headers.get("Host", "").partition(":")[0] not in (_HOST, "localhost"):
            self.send_error(HTTPStatus.FORBIDDEN)
        elif self.path.partition("?")[0] != "/":
            self.send_error(HTTPStatus.NOT_FOUND)
        else:
            self.send_response(HTTPStatus.OK)
            for name, value in (_HEADERS | {"Content-Length": str(len(self.server.page))}).items():
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(self.server.page)

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002
        """Print nothing: the terminal belongs to the user."""

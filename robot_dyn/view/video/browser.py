r"""A browser without a window, driven by the DevTools protocol over two pipes: it listens on no port.

    to it      {"id": 1, "method": "Runtime.evaluate", "params": {…}}\0
    from it    {"id": 1, "result": {…}}\0, and events, which have no id

It ends with the pipes, so that none is left when the program is killed. [chromedevtools.github.io/devtools-protocol]
"""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic
from typing import Any, final

from robot_dyn.foundations.errors import VideoError, shorten
from robot_dyn.foundations.files import why

_PATIENCE_S = 120.0  # for an answer; a machine with a slow disk takes tens of seconds to start a browser
_END_S = 5.0  # for the browser to end when it is asked to
_READ = 2**20  # [bytes], at a time
_MOST_ANSWER = 2**28  # [bytes]
# WebGL by the processor, so that pictures do not depend on a graphics card; no network, no profile, no questions.
_FLAGS = (
    "--headless=new", "--remote-debugging-pipe", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--host-resolver-rules=MAP * ~NOTFOUND", "--disable-background-networking", "--disable-component-update",
    "--disable-sync", "--disable-quic", "--disable-extensions", "--disable-breakpad", "--no-first-run",
    "--no-default-browser-check", "--password-store=basic", "--use-mock-keychain", "--mute-audio", "--hide-scrollbars",
    "--force-color-profile=srgb", "--font-render-hinting=none", "--disable-dev-shm-usage",
)  # fmt: skip
# Pipes are 3 and 4 in the browser, which Python gives other numbers; no text of a user is read by the shell.
_AS_3_AND_4 = 'exec "$0" "$@" 3</dev/fd/{} 4>/dev/fd/{}'


@final
class Browser:
    """A tab of a running browser; `browser` starts it."""

    def __init__(self, to_it: int, from_it: int) -> None:
        """Talk over two pipes, by their descriptors."""
        self._to_it, self._from_it = to_it, from_it
        os.set_blocking(to_it, False)
        self._received, self._count, self._session = bytearray(), 0, {}
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        self._session = {"sessionId": session}

    def call(self, method: str, **params: Any) -> dict[str, Any]:
        """The answer to a call.

        Raises:
            VideoError: If it refuses the call, ends, or does not answer in time.
        """
        self._count += 1
        until = monotonic() + _PATIENCE_S
        self._send({"id": self._count, "method": method, "params": params} | self._session, until)
        while (answer := self._receive(until)).get("id") != self._count:
            if answer.get("method") == "Inspector.targetCrashed":
                raise VideoError("the page has crashed in the browser; is there enough memory?")
        if "error" in answer:
            raise VideoError(f"the browser refuses {method}: {shorten(answer['error'].get('message'))}")
        return answer["result"]

    def ask(self, expression: str) -> Any:
        """The value of an expression in the page, or of its promise.

        Raises:
            VideoError: If it raises, and as of `call`.
        """
        answer = self.call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        if failure := answer.get("exceptionDetails"):
            said = failure.get("exception", {}).get("description", failure.get("text"))
            raise VideoError(f"the page fails in this browser: {shorten(said)}; it must be of 2023 or later")
        return answer["result"].get("value")

    def _send(self, message: dict[str, Any], until: float) -> None:
        left = memoryview(json.dumps(message).encode() + b"\0")
        while left:
            _wait(self._to_it, select.POLLOUT, until)
            try:
                left = left[os.write(self._to_it, left) :]
            except BlockingIOError:
                continue
            except OSError:
                raise VideoError("the browser has ended") from None

    def _receive(self, until: float) -> dict[str, Any]:
        """The next message."""
        while (end := self._received.find(0)) < 0:
            _wait(self._from_it, select.POLLIN, until)
            read = os.read(self._from_it, _READ)
            if not read or len(self._received) > _MOST_ANSWER:
                raise VideoError("the browser has ended")
            self._received += read
        message = bytes(self._received[:end])
        del self._received[: end + 1]
        return json.loads(message)


def _wait(descriptor: int, event: int, until: float) -> None:
    """Return when a pipe can be read or written."""
    waiting = select.poll()
    waiting.register(descriptor, event)
    if not waiting.poll(max(until - monotonic(), 0.0) * 1e3):
        raise VideoError(f"the browser has not answered for {_PATIENCE_S:g} s; close other programs, or try again")


@contextmanager
def browser(program: Path) -> Iterator[Browser]:
    """A browser with a profile of its own among the temporary files; it ends, and the profile goes, with the context.

    Raises:
        VideoError: If it does not start.
    """
    with TemporaryDirectory(prefix="robot_dyn-", ignore_cleanup_errors=True) as folder:
        said = Path(folder) / "said"
        (its_in, to_it), (from_it, its_out) = os.pipe(), os.pipe()
        process = None
        try:
            process = _start(program, Path(folder) / "profile", said, its_in, its_out)
            for each in (its_in, its_out):
                os.close(each)
            try:
                yield Browser(to_it, from_it)
            except VideoError as error:
                raise VideoError(f"{program}: {error}{_last_words(said)}") from None
        finally:
            for each in (to_it, from_it):
                os.close(each)
            if process is not None:
                _end(process)


def _start(program: Path, profile: Path, said: Path, its_in: int, its_out: int) -> subprocess.Popen[bytes]:
    flags = [*_FLAGS, f"--user-data-dir={profile}"]
    if os.geteuid() == 0:
        flags.append("--no-sandbox")  # without it browsers do not start for root
    command = ["/bin/sh", "-c", _AS_3_AND_4.format(its_in, its_out), str(program), *flags, "about:blank"]
    try:
        with said.open("wb") as log:
            return subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, pass_fds=(its_in, its_out),
                start_new_session=True,  # Ctrl-C in a terminal reaches this program alone, which then ends the browser
            )  # fmt: skip
    except OSError as cause:
        raise VideoError(f"{program}: does not start ({why(cause)})") from None


def _end(process: subprocess.Popen[bytes]) -> None:
    """Wait until it has ended with its pipes; then end what it may have left."""
    try:
        with suppress(subprocess.TimeoutExpired):
            process.wait(_END_S)
    finally:
        with suppress(OSError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _last_words(said: Path) -> str:
    """Why it ended, or what it printed last."""
    with suppress(OSError):
        lines = said.read_text(encoding="utf-8", errors="replace").splitlines()
        if lines:
            return f"; it said: {shorten(next((line for line in lines if ':FATAL:' in line), lines[-1]))}"
    return ""

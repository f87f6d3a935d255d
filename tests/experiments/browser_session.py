"""Drives headless Chromium over its debugging protocol: size, colours, printing, scripts in the page."""

import base64
import itertools
import json
import os
import signal
import subprocess
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import websocket

from tests.experiments.browser import FLAGS, chromium

PATIENCE = 120.0  # s


class Session:
    """One tab of a browser."""

    def __init__(self, address: str, process: int = 0) -> None:
        """Connects to a tab of the browser with that process id."""
        self.process = process
        self._socket = websocket.create_connection(address, timeout=PATIENCE, suppress_origin=True)
        self._numbers = itertools.count(1)
        self.requests: list[str] = []  # addresses that the pages asked for
        self.complaints: list[str] = []  # errors on the console
        for domain in ("Page", "Runtime", "Network"):
            self.send(f"{domain}.enable")

    def send(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Sends a command and waits for its answer.

        Raises:
            AssertionError: if the browser refuses it.
        """
        number = next(self._numbers)
        self._socket.send(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._socket.recv())
            if message.get("id") == number:
                assert "error" not in message, f"{method}: {message['error']}"
                return message["result"]
            self._note(message)

    def _note(self, message: dict[str, Any]) -> None:
        said = message.get("params", {})
        if message["method"] == "Network.requestWillBeSent":
            self.requests.append(said["request"]["url"])
        elif message["method"] == "Runtime.exceptionThrown":
            self.complaints.append(json.dumps(said["exceptionDetails"])[:500])
        elif message["method"] == "Runtime.consoleAPICalled" and said["type"] == "error":
            self.complaints.append(json.dumps(said["args"])[:500])

    def run(self, script: str) -> Any:
        """The value of an expression in the page; a promise is waited for.

        Raises:
            AssertionError: if it throws.
        """
        answer = self.send("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, answer.get("exceptionDetails")
        return answer["result"].get("value")

    def view(self, width: int, height: int, dark: bool = False) -> None:
        """Sets the size of the view in px, as a phone has it below 600, and the colour scheme."""
        self.send(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=width < 600,
        )
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.send("Emulation.setEmulatedMedia", features=[scheme])

    def open(self, page: Path, ready: str = "document.body.dataset.printable === 'yes'") -> None:
        """Opens a file and waits until an expression is true in it.

        Raises:
            AssertionError: if it does not become true.
        """
        self.send("Page.navigate", url=page.resolve().as_uri())
        end = time.monotonic() + PATIENCE
        while not self.run(f"document.readyState === 'complete' && !!document.body && ({ready})"):
            assert time.monotonic() < end, f"{page}: {ready} did not become true; {self.complaints}"
            time.sleep(0.1)

    def picture(self, image: Path, whole_page: bool = False) -> None:
        """Takes a picture of what is seen, or of the whole page."""
        more: dict[str, Any] = {}
        if whole_page:
            size = self.send("Page.getLayoutMetrics")["cssContentSize"]
            more = {"captureBeyondViewport": True, "clip": {**size, "scale": 1}}
        image.write_bytes(base64.b64decode(self.send("Page.captureScreenshot", **more)["data"]))

    def pdf(self, file: Path) -> None:
        """Prints the page on A4."""
        paper = {"paperWidth": 8.27, "paperHeight": 11.69, "printBackground": False}
        file.write_bytes(base64.b64decode(self.send("Page.printToPDF", **paper)["data"]))

    def close(self) -> None:
        """Ends the connection."""
        self._socket.close()


@contextmanager
def browser() -> Iterator[Session]:
    """A browser with one empty tab; skips the test where there is none."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        flags = [*FLAGS, f"--user-data-dir={profile}", "--remote-debugging-port=0", "about:blank"]
        process = subprocess.Popen(
            [chromium(), *flags], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
        )
        session = None
        try:
            session = Session(_tab(Path(profile)), process.pid)
            yield session
        finally:
            if session:
                session.close()
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def _tab(profile: Path) -> str:
    """The address of the tab; Chromium writes its port into its profile."""
    end = time.monotonic() + PATIENCE
    note = profile / "DevToolsActivePort"
    while not note.is_file() or len(note.read_text().splitlines()) < 2:
        assert time.monotonic() < end, "Chromium did not open its debugging port"
        time.sleep(0.05)
    port = note.read_text().splitlines()[0]
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/json/list", timeout=PATIENCE) as answer:
        tabs = json.load(answer)
    return str(next(tab["webSocketDebuggerUrl"] for tab in tabs if tab["type"] == "page"))

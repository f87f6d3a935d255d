"""Opens a file in headless Chromium, where it is installed."""

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--enable-unsafe-swiftshader",  # WebGL without a graphics card
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--hide-scrollbars",
    "--enable-logging=stderr",
)
LOG_LINE = re.compile(r'INFO:CONSOLE[^\]]*\] "(.*)", source: ')


@dataclass(frozen=True)
class Opened:
    """What a browser made of a page."""

    dom: str  # the document after its scripts have run
    console: list[str]  # what it wrote to the console, errors among it


def chromium() -> str:
    """The browser's executable; skips the test, saying so, where there is none."""
    for name in NAMES:
        path = shutil.which(name)
        if path:
            return path
    pytest.skip(f"no Chromium on this machine, looked for {', '.join(NAMES)}")


def open_page(path: Path, milliseconds: int = 8000) -> Opened:
    """Lets the scripts of a page run for that much virtual time; returns the document and the console."""
    output = _run(path, ["--dump-dom", f"--virtual-time-budget={milliseconds}"])
    return Opened(output.stdout, LOG_LINE.findall(output.stderr))


def screenshot(path: Path, image: Path, width: int, height: int, milliseconds: int = 8000) -> None:
    """Takes a picture of a page in a view of that size.

    Windows cannot be narrower than about 500 pixels, so the page is shown in a frame.
    """
    with tempfile.TemporaryDirectory() as folder:
        frame = Path(folder) / "frame.html"
        frame.write_text(
            f'<body style="margin:0"><iframe src="{path.resolve().as_uri()}" '
            f'style="border:0;width:{width}px;height:{height}px"></iframe></body>'
        )
        size = f"--window-size={width},{height}"
        _run(frame, [f"--screenshot={image}", size, f"--virtual-time-budget={milliseconds}"])


def _run(path: Path, arguments: list[str], timeout: float = 300.0) -> subprocess.CompletedProcess[str]:
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        command = [chromium(), *FLAGS, f"--user-data-dir={profile}", *arguments, path.resolve().as_uri()]
        # Chromium starts helpers; its own session lets a browser that hangs be ended with all of them.
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
        )
        try:
            stdout, stderr = process.communicate(timeout=timeout)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            stdout, stderr = process.communicate()
            raise AssertionError(f"Chromium did not finish {path} in {timeout} s: {stderr[-2000:]}") from None
    if process.returncode != 0:
        print(stderr, file=sys.stderr)
        raise AssertionError(f"Chromium ended with code {process.returncode} on {path}")
    return subprocess.CompletedProcess(command, process.returncode, stdout, stderr)

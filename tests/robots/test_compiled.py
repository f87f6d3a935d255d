"""What numba keeps of a function is not used once a function that it calls has changed."""

import os
import subprocess
import sys
import time

import pytest

from robots.compiled import drop_outdated

INNER = """
from numba import njit


@njit(cache=True)
def inner(x):
    return {factor} * x
"""
OUTER = """
from numba import njit
from robots.inner import inner


@njit(cache=True)
def outer(x):
    return inner(x)
"""


def answer(root) -> str:
    command = [sys.executable, "-c", "from robots.outer import outer; print(outer(1.0))"]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    return subprocess.run(
        command, cwd=root, env=environment, capture_output=True, text=True, check=True
    ).stdout


@pytest.mark.slow
def test_what_calls_a_changed_function_is_compiled_anew(tmp_path):
    folder = tmp_path / "robots"
    folder.mkdir()
    for name, text in (("__init__", ""), ("inner", INNER.format(factor=2.0)), ("outer", OUTER)):
        (folder / f"{name}.py").write_text(text)
    assert answer(tmp_path) == "2.0\n"
    drop_outdated(tmp_path)
    assert list(folder.rglob("*.nbi"))  # nothing has changed
    (folder / "inner.py").write_text(INNER.format(factor=3.0))
    later = time.time() + 1.0  # the clock of files may be coarse
    os.utime(folder / "inner.py", (later, later))
    drop_outdated(tmp_path)
    assert answer(tmp_path) == "3.0\n"

"""Atomic writing of result files."""

import json
import os
from pathlib import Path
from typing import Any


def write_text(path: str | Path, text: str) -> None:
    """Writes ``text`` in UTF-8 to a temporary file beside ``path`` and puts it in its place in one step.

    Raises:
        OSError: if the folder is missing or cannot be written; an older file at ``path`` is then untouched.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with open(temporary, "w", encoding="utf-8", newline="\n") as stream:
            stream.write(text)
        os.replace(temporary, path)
    except OSError as error:
        if error.filename is not None:
            raise
        # A full disk is reported without the file.
        raise OSError(error.errno, error.strerror, str(path)) from error
    finally:
        temporary.unlink(missing_ok=True)


def write_json(path: str | Path, data: Any) -> None:
    """Writes ``data`` as JSON in its own order of keys, atomically; NaN is refused.

    Raises:
        OSError: if the folder is missing or cannot be written.
        ValueError: if a number is NaN or infinite.
    """
    write_text(path, json_text(data))


def json_text(data: Any) -> str:
    """The data as JSON in its own order of keys. Raises ValueError if a number is NaN or infinite."""
    return json.dumps(data, indent=2, allow_nan=False, ensure_ascii=False) + "\n"

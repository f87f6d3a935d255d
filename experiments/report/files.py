"""Writing a result so that a reader finds the old file or the new one, never half of one."""

import os
from pathlib import Path


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
    finally:
        temporary.unlink(missing_ok=True)

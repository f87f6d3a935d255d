"""Results that appear all at once, or not at all."""

import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

PAGE = (".html", ".htm")
YAML = (".yaml", ".yml")
TABLE = (".csv", ".txt")


@contextmanager
def staged_folder(folder: str | Path) -> Iterator[Path]:
    """Gives a temporary folder whose files move to ``folder`` when the block ends well.

    It is made on entry, inside ``folder`` or its nearest existing parent: where that fails, the results
    would have failed too, and one knows before the work begins. If the block raises, nothing remains.

    Raises:
        OSError: if the folder cannot be made or written; one line that says which and why.
    """
    folder = Path(folder)
    try:
        place = _nearest_existing(folder)
        stage = Path(tempfile.mkdtemp(prefix=".truetip-", dir=place))
    except OSError as error:
        raise OSError(f"cannot write in folder {folder}: {_reason(error)}") from error
    try:
        yield stage
        try:
            folder.mkdir(parents=True, exist_ok=True)
            for path in sorted(stage.iterdir()):
                os.replace(path, folder / path.name)
        except OSError as error:
            raise OSError(f"cannot write in folder {folder}: {_reason(error)}") from error
    finally:
        shutil.rmtree(stage, ignore_errors=True)


@contextmanager
def staged_file(path: str | Path, *suffixes: str) -> Iterator[Path]:
    """The same for a single file: gives the path to write to, in the temporary folder.

    Args:
        path: of the file.
        suffixes: one of which its name must have, so that other programs know what it holds.

    Raises:
        OSError: if the file cannot be written or has another suffix; one line that says which and why.
    """
    path = Path(path)
    if path.is_dir():
        raise OSError(f"cannot write the file {path}: it is a folder")
    check_suffix(path, suffixes)
    with staged_folder(path.parent) as stage:
        yield stage / path.name


def check_suffix(path: str | Path, suffixes: Sequence[str]) -> None:
    """Raises OSError, one line, if there are suffixes and the name of a file ends in none of them."""
    if suffixes and Path(path).suffix.lower() not in suffixes:
        raise OSError(f"cannot write the file {path}: its name must end in {' or '.join(suffixes)}")


def keep_files(stage: Path, folder: Path) -> None:
    """Copies what has been staged so far to ``folder``, for work that will end in an error.

    File by file, because the staged folder itself is readable by its owner alone.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for path in stage.iterdir():
        shutil.copyfile(path, folder / path.name)


def _nearest_existing(folder: Path) -> Path:
    """The folder itself or its first parent that exists."""
    while not os.path.lexists(folder) and folder != folder.parent:
        folder = folder.parent
    return folder


def _reason(error: OSError) -> str:
    return (error.strerror or str(error)).lower()

"""A guess at what somebody meant who named something that there is not."""

from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path

# Share of what two names have in common, from which one may stand for the other.
_ALIKE, _SHORT_ALIKE = 0.72, 0.65
_SHORT = 4  # characters of a short name, of which one wrong letter is much


def did_you_mean(given: object, known: Iterable[str]) -> str:
    """The end of a message: ``; did you mean placement?``, empty where nothing is alike."""
    names = {name.lower().lstrip("-"): name for name in known if name}
    wanted = str(given).lower().lstrip("-")
    alike = get_close_matches(wanted, names, n=2, cutoff=_SHORT_ALIKE if len(wanted) <= _SHORT else _ALIKE)
    return f"; did you mean {' or '.join(names[name] for name in alike)}?" if alike else ""


def why_no_file(path: Path, is_path: bool, *endings: str) -> str:
    """Why there is no file of what is named either as it is shipped or by a path.

    Args:
        path: where the file would be if a path was meant.
        is_path: whether it was, as the name ends in one of the endings.
        endings: those of paths, such as ``".yaml"``.
    """
    if is_path:
        return f"no file {path}"
    if path.is_file():
        return f"the name of a file must end in {' or '.join(endings)}"
    return "no file of that name comes with truetip"

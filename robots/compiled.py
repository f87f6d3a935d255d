"""Loops that numba compiles once a machine, keeps beside their source, and compiles anew when one changes.

numba takes a third of a second to import. Only who computes in every tick imports what is compiled, when it
is made.
"""

from pathlib import Path
from typing import Any

from numba import njit

_FLOORS = "robots", "systems"


def drop_outdated(root: Path) -> None:
    """Removes what is kept of compiled functions if the source of any of them is newer.

    numba looks at the file of a function alone, but a function contains those that it calls, also such of
    other files. What it kept of a caller would go on with the former code.

    Args:
        root: the folder with the packages.
    """
    kept = [file for floor in _FLOORS for file in (root / floor).rglob("__pycache__/*.nbi")]
    sources = {file.parent.parent / f"{file.name.split('.')[0]}.py" for file in kept}
    newest = max((source.stat().st_mtime for source in sources if source.exists()), default=0.0)
    for file in kept:
        try:
            if file.stat().st_mtime < newest:
                file.unlink()
        except OSError:  # somebody else has removed it, or nobody may
            continue


drop_outdated(Path(__file__).parents[1])


# The way into C is not needed; numba takes the last options without declaring them. A division by zero gives
# inf or NaN, as numpy's does.
_jit: Any = njit
compiled = _jit(cache=True, error_model="numpy", no_cfunc_wrapper=True, nogil=True)
# What only other loops call: its way into Python need not be compiled either.
inner = _jit(cache=True, error_model="numpy", no_cfunc_wrapper=True, no_cpython_wrapper=True)

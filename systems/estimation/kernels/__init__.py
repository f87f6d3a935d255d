"""What the estimators work out in every tick, as loops that numba compiles.

numba takes half a second to import. No command that runs another law shall wait for it, so the modules in
here are imported when something in them is asked for: ``kernels.tip.predict(...)``. What is compiled is kept
beside the source (``__pycache__``); only the first process after a change compiles.
"""

from importlib import import_module
from types import ModuleType

_COMPILED = (
    "dead_time",
    "drives",
    "gain_search",
    "gears",
    "geometry",
    "history",
    "information",
    "innovations",
    "keyframes",
    "loads",
    "plan",
    "poses",
    "tip",
)


def __getattr__(name: str) -> ModuleType:
    if name not in _COMPILED:
        raise AttributeError(f"module {__name__} has no attribute {name}")
    return import_module(f"{__name__}.{name}")

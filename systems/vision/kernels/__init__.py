"""What is worked out for every frame of the marker cameras, as loops that numba compiles.

numba takes half a second to import. Not everybody looks at markers, so the modules in here are imported when
something in them is asked for: ``kernels.frames.match(...)``.
"""

from importlib import import_module
from types import ModuleType

_COMPILED = ("components", "frames")


def __getattr__(name: str) -> ModuleType:
    if name not in _COMPILED:
        raise AttributeError(f"module {__name__} has no attribute {name}")
    return import_module(f"{__name__}.{name}")

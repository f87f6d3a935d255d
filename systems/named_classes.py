"""Classes by name: those that come with truetip, and ``my_file.py:MyClass`` from a file of one's own."""

import hashlib
import importlib
import importlib.util
import multiprocessing
import re
import sys
import traceback
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import ModuleType

from robots.configuration.suggestion import did_you_mean

_OWN_FILES: dict[str, str] = {}  # those that were imported here, by their path the name of the module
_READ: dict[str, bytes] = {}  # what stood in them, by the name of the module
_CALLED = re.compile(
    r"(\w+)\.(\w+)\(\) (?:takes|missing|got) "
)  # a wrong number of arguments, or one unknown


class OwnClassError(RuntimeError):
    """A class of one's own gives what it must not; the message says which class and what."""


class NamedClasses(Mapping[str, type]):
    """The classes of one kind that come with truetip, each imported when it is first asked for.

    A new one is one line more; nothing that is not used is loaded, and no room imports another to list it.
    """

    def __init__(self, kind: str, places: Mapping[str, str]) -> None:
        """Lists them.

        Args:
            kind: what they are, for messages: ``"law"``.
            places: by name the module and the class: ``"systems.servo.pbvs:Pbvs"``.
        """
        self._kind, self._places = kind, dict(places)

    def __getitem__(self, name: str) -> type:
        module, _, class_name = self._places[name].partition(":")
        return getattr(importlib.import_module(module), class_name)

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)

    def name_of(self, kind: type) -> str | None:
        """The name of a class; None if it does not come with truetip."""
        place = f"{kind.__module__}:{kind.__qualname__}"
        return next((name for name, listed in self._places.items() if listed == place), None)

    def find(self, name: str) -> type:
        """The class of a name, or of ``FILE.py:CLASS``.

        Raises:
            ValueError: if there is no such name, file or class, or the file cannot be imported; one line.
        """
        if name in self._places:
            return self[name]
        file, colon, class_name = name.rpartition(":")
        if not (colon and file.endswith(".py")):
            guess = did_you_mean(name, self)
            allowed = ", ".join(self)
            raise ValueError(f"{self._kind} must be one of {allowed}, or FILE.py:CLASS, got '{name}'{guess}")
        found = getattr(_module_of(file, self._kind), class_name, None)
        if not isinstance(found, type):
            guess = did_you_mean(class_name, _classes_in(file, self._kind))
            raise ValueError(f"{self._kind}: {file} has no class '{class_name}'{guess}")
        return found


def read_changed_files_again() -> None:
    """What a file of one's own says now counts from here on, not what it said when it was first imported.

    To be called where work begins, as in a session in which the file is edited between two runs. A process
    that was given its work by another keeps what it has read: the runs of one study are of one law.
    """
    if multiprocessing.parent_process() is not None:
        return
    for file, name in _OWN_FILES.items():
        if name in sys.modules and _text(Path(file)) != _READ.get(name):
            del sys.modules[name]


def place_in_own_file(error: BaseException) -> str | None:
    """Where in a file of one's own an error arose: ``law.py, line 5, in step: KeyError: 'gain'``, one line.

    None if no such file had a part in it: then it is a defect of truetip, and its traceback is wanted.
    """
    frame = _own_frame(error) or _own_method_called(error)
    return None if frame is None else f"{Path(frame.filename).name}, {_line(frame)}: {_told(error)}"


def _own_frame(error: BaseException) -> traceback.FrameSummary | None:
    """The innermost call in a file of one's own through which an error came."""
    own = {file for file, name in _OWN_FILES.items() if name in sys.modules}
    frames = reversed(traceback.extract_tb(error.__traceback__))
    return next((frame for frame in frames if frame.filename in own), None)


def _own_method_called(error: BaseException) -> traceback.FrameSummary | None:
    """The method of one's own that does not take what it was given: Python names it, but is not in it yet."""
    called = _CALLED.match(str(error)) if isinstance(error, TypeError) else None
    if called is None:
        return None
    for name in _OWN_FILES.values():
        method = getattr(getattr(sys.modules.get(name), called[1], None), called[2], None)
        code = getattr(method, "__code__", None)
        if code is not None and code.co_filename in _OWN_FILES:
            return traceback.FrameSummary(code.co_filename, code.co_firstlineno, called[2])
    return None


def _line(frame: traceback.FrameSummary) -> str:
    return f"line {frame.lineno}" + ("" if frame.name == "<module>" else f", in {frame.name}")


def _told(error: BaseException) -> str:
    """Kind and message of an error in one line."""
    message = error.msg if isinstance(error, SyntaxError) else error
    return " ".join(f"{type(error).__name__}: {message}".removesuffix(": ").split())


def _import_problem(file: str, error: BaseException) -> str:
    """Why a file of one's own cannot be imported, with the line; one line."""
    if isinstance(error, SyntaxError) and error.filename and error.lineno:  # there, or in what it imports
        is_itself = Path(error.filename).resolve() == Path(file).resolve()
        return f"{file if is_itself else error.filename}, line {error.lineno}: {_told(error)}"
    frame = _own_frame(error)
    return f"{file}, {_line(frame)}: {_told(error)}" if frame else f"{file}: {_told(error)}"


def _classes_in(file: str, kind: str) -> list[str]:
    module = _module_of(file, kind)
    return [name for name, each in vars(module).items() if isinstance(each, type)]


def _text(path: Path) -> bytes | None:
    return path.read_bytes() if path.is_file() else None


def _module_of(file: str, kind: str) -> ModuleType:
    """The module that a file holds, imported once a process. Raises ValueError, one line."""
    path = Path(file).resolve()
    # Two files of the same name are two modules; registered, so that its objects can travel to processes.
    name = f"{path.stem}_{hashlib.sha256(str(path).encode()).hexdigest()[:8]}"
    if name in sys.modules:
        return sys.modules[name]
    if not path.is_file():
        raise ValueError(f"{kind}: there is no file {file}")
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ValueError(f"{kind}: {file} is no Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    _OWN_FILES[str(path)] = name
    try:
        # Not by the loader: it takes a file of the same second and size for the one that it has compiled.
        _READ[name] = path.read_bytes()
        exec(compile(_READ[name], str(path), "exec"), module.__dict__)
    except (Exception, SystemExit) as error:  # whatever the file of somebody else does when it is imported
        problem = _import_problem(file, error)
        del sys.modules[name]
        raise ValueError(f"{kind}: {problem}") from error
    return module

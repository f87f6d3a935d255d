"""The shapes that picture the links of a URDF, with the files of their meshes.

They are read from the text: Drake's parser leaves out meshes of kinds that its own viewer cannot show, and
refuses a file one of whose packages it does not find.
"""

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from robots.description.pictures.picture import Picture
from robots.description.placement import placement_entry
from robots.description.urdf_in.chain import UrdfText

_PACKAGE = "package://"


class Pictures:
    """Pictures of links, as a robot file says them."""

    def __init__(self, text: UrdfText, packages: Mapping[str, Path]) -> None:
        """``packages`` are folders of packages by their names; others are looked for above the file."""
        self._text, self._packages = text, dict(packages)
        self.missing: list[str] = []  # meshes that were not found
        self.unreadable: list[str] = []  # why those that were found are left out

    def of(self, link: str, X_LB: RigidTransform) -> list[dict]:
        """Of a link that is fixed at X_LB to its body; shapes for collision where it has no others."""
        element = self._text.root.find(f"link[@name='{link}']")
        assert element is not None
        for role in ("visual", "collision"):
            found = [self._entry(shape, X_LB) for shape in element.findall(role)]
            shown = [entry for entry in found if entry is not None]
            if shown:
                return shown
        return []

    def _entry(self, element: ElementTree.Element, X_LB: RigidTransform) -> dict | None:
        origin, geometry = element.find("origin"), element.find("geometry")
        if geometry is None or not len(geometry):
            return None
        X = X_LB @ origin_pose(origin)
        shape = geometry[0]
        entry = {"shape": shape.tag, "placement": placement_entry(X, f"URDF {self._text.path.name}")}
        if shape.tag == "box":
            return entry | {"size": _floats(shape.get("size"), 3)}
        if shape.tag in ("cylinder", "sphere"):
            names = ("radius", "length") if shape.tag == "cylinder" else ("radius",)
            return entry | {"size": [_floats(shape.get(name), 1)[0] for name in names]}
        if shape.tag != "mesh":
            return None
        uri = shape.get("filename", "")
        file = self._file(uri)
        if file is None:
            self.missing.append(uri)
            return None
        size = _floats(shape.get("scale", "1 1 1"), 3)
        problem = Picture("mesh", str(file), size).problem()
        if problem:
            self.unreadable.append(problem)
            return None
        return entry | {"file": str(file), "size": size}

    def _file(self, uri: str) -> Path | None:
        """The file that a URI names, or None if there is none."""
        if not uri.startswith(_PACKAGE):
            path = self._text.path.parent / uri.removeprefix("file://")
            return path.resolve() if path.is_file() else None
        package, _, inside = uri.removeprefix(_PACKAGE).partition("/")
        above = [folder for folder in self._text.path.resolve().parents if folder.name == package]
        folders = [self._packages[package]] if package in self._packages else above
        return next((path.resolve() for f in folders if (path := f / inside).is_file()), None)


def origin_pose(origin: ElementTree.Element | None) -> RigidTransform:
    """The pose that an ``<origin>`` says; the identity if there is none."""
    if origin is None:
        return RigidTransform()
    xyz, rpy = (_floats(origin.get(name, "0 0 0"), 3) for name in ("xyz", "rpy"))
    return RigidTransform(RollPitchYaw(np.array(rpy)), xyz)


def _floats(text: str | None, count: int) -> list[float]:
    values = [float(part) for part in (text or "").split()]
    if len(values) != count:
        raise ValueError(f"a shape needs {count} numbers, got '{text}'")
    return values

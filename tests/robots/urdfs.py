"""URDFs for tests: those of UR5 and UR10 as others publish them, and small ones made of text."""

from collections.abc import Sequence
from functools import cache
from importlib.metadata import files
from pathlib import Path


@cache
def published(name: str) -> Path:
    """A URDF of the package example-robot-data, such as ``ur10_robot.urdf``."""
    entries = files("example-robot-data") or []
    return Path(str(next(entry for entry in entries if entry.name == name).locate())).resolve()


def link(name: str, has_inertia: bool = True, shape: str = "") -> str:
    inertia = '<inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0.001" ixz="-0.002" iyz="0.003"/>'
    inertial = f'<inertial><origin xyz="0.01 0 0.1" rpy="0.1 0.2 0.3"/><mass value="2"/>{inertia}</inertial>'
    return f'<link name="{name}">{inertial if has_inertia else ""}{shape}</link>\n'


def joint(name: str, parent: str, child: str, kind: str = "revolute", more: str = "") -> str:
    axis = '<axis xyz="0 0 1"/>' if name[-1] in "14" else '<axis xyz="0 1 0"/>'
    limit = '<limit lower="-2" upper="2.5" velocity="3" effort="10"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.02 0.01 0.2"/>{axis}{limit}{more}</joint>\n'
    )


def arm(axes: int = 6, kinds: dict[int, str] | None = None, more: str = "", bare: Sequence[int] = ()) -> str:
    """A chain of links l0, l1, ... with joints j1, j2, ..., turned about z, y, y, z, y, y.

    Args:
        axes: number of joints.
        kinds: of joints by their numbers, where they are not revolute.
        more: what else stands in the file.
        bare: numbers of links without inertia.
    """
    links = "".join(link(f"l{k}", k not in bare) for k in range(axes + 1))
    joints = "".join(
        joint(f"j{k}", f"l{k - 1}", f"l{k}", (kinds or {}).get(k, "revolute")) for k in range(1, axes + 1)
    )
    return f'<robot name="small">\n{links}{joints}{more}</robot>\n'

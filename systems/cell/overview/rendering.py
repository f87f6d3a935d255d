"""Pictures of a simulated cell with Drake's VTK renderer: still things, the robot and people."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import (
    Box,
    Capsule,
    ClippingRange,
    ColorRenderCamera,
    FrameId,
    FramePoseVector,
    GeometryFrame,
    GeometryInstance,
    LightParameter,
    MakeRenderEngineVtk,
    Mesh,
    MeshSource,
    PerceptionProperties,
    RenderCameraCore,
    RenderEngineVtkParams,
    RenderLabel,
    Rgba,
    SceneGraph,
    Shape,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.sensors import CameraInfo

from robots.kinematics.arm_capsules import Capsules
from systems.cell.overview.person import standing
from systems.vision.camera_model import Cameras
from systems.vision.people.surroundings import Surroundings

_SKY, _FLOOR, _ROBOT = (0.35, 0.37, 0.4), (0.45, 0.45, 0.42), (0.95, 0.5, 0.1)
# Directions and intensities of the light: from above, and from four sides.
_LAMPS = (
    ((0, 0, -1), 0.6),
    ((1, 1, -0.7), 0.35),
    ((-1, 1, -0.7), 0.25),
    ((1, -1, -0.7), 0.3),
    ((-1, -1, -0.7), 0.2),
)
_AWAY = RigidTransform([0.0, 0.0, -100.0])  # where nobody is seen
_ENGINE, _FLOOR_EDGE, _FLOOR_DEPTH = "cell", 14.0, 0.02  # m
_CLIPPING = ClippingRange(0.1, 40.0)  # m
_MESHES, _TRUNK = (".obj", ".gltf", ".glb"), 1  # whose clothes a mesh without colours of its own has
_SHORTEST = 1e-4  # m, of a capsule


class CellPictures:
    """Draws what n cameras see of a robot and of people, lenses included."""

    def __init__(
        self,
        cameras: Cameras,
        size: tuple[int, int],
        surroundings: Surroundings,
        robot: Capsules,
        people: Sequence[Capsules] = (),
        colors: Sequence[tuple[float, float, float]] = (),
        meshes: Sequence[str] = (),
    ) -> None:
        """Builds the scene.

        Args:
            cameras: n cameras.
            size: width and height of an image in px.
            surroundings: what stands still.
            robot: its capsules at any joint positions; their lengths and radii stay.
            people: the figure of each, likewise.
            colors: of the capsules of a figure, red, green and blue.
            meshes: files that are drawn in place of the figures, empty for a figure; none for figures alone.

        Raises:
            ValueError: if there is no such file.
        """
        self._floor = surroundings.floor
        self._scene = SceneGraph()
        lamps = [
            LightParameter(type="directional", frame="world", direction=list(way), intensity=intensity)
            for way, intensity in _LAMPS
        ]
        look = RenderEngineVtkParams(default_clear_color=list(_SKY), lights=lamps)
        self._scene.AddRenderer(_ENGINE, MakeRenderEngineVtk(look))
        self._source = self._scene.RegisterSource(_ENGINE)
        floor = RigidTransform([0.0, 0.0, surroundings.floor - 0.5 * _FLOOR_DEPTH])
        self._still("floor", Box(_FLOOR_EDGE, _FLOOR_EDGE, _FLOOR_DEPTH), floor, _FLOOR)
        for number, each in enumerate(surroundings.furniture, 1):
            name = f"furniture {number}"
            self._still(name, Box(each.size), each.placement.pose(), tuple(each.color))
        self._robot = self._moving("robot", robot, [_ROBOT] * len(robot.radius))
        self._meshes = list(meshes) or [""] * len(people)
        self._people = [
            self._mesh(f"person {k}", mesh, colors) if mesh else self._moving(f"person {k}", each, colors)
            for k, (each, mesh) in enumerate(zip(people, self._meshes, strict=True))
        ]
        self._context = self._scene.CreateDefaultContext()
        self._lenses = [_Lens(cameras.subset([i]), size) for i in range(len(cameras))]

    def take(self, robot: Capsules, people: Sequence[Capsules | None] = ()) -> np.ndarray:
        """One set of images.

        Args:
            robot: where its capsules are.
            people: likewise of each figure; None for one that is not there.

        Returns:
            (n, height, width, 3) of uint8: blue, green, red, as OpenCV has them.
        """
        poses = FramePoseVector()
        drawn = zip([self._robot, *self._people], [robot, *people], ["", *self._meshes], strict=True)
        for frames, capsules, mesh in drawn:
            for k, frame in enumerate(frames):
                if capsules is None:
                    X = _AWAY
                elif mesh:
                    X = standing(capsules, self._floor)
                else:
                    X = _placed(capsules.start[k], capsules.end[k])
                poses.set_value(frame, X)
        self._scene.get_source_pose_port(self._source).FixValue(self._context, Value(poses))
        query = self._scene.get_query_output_port().Eval(self._context)
        world = self._scene.world_frame_id()
        return np.stack(
            [
                lens.seen(query.RenderColorImage(lens.camera, world, lens.X_WC).data[..., 2::-1])
                for lens in self._lenses
            ]
        )

    def _still(self, name: str, shape: Shape, X: RigidTransform, color: tuple[float, ...]) -> None:
        self._scene.RegisterAnchoredGeometry(self._source, _painted(name, shape, X, color))

    def _mesh(self, name: str, file: str, colors: Sequence[tuple[float, ...]]) -> list[FrameId]:
        path = Path(file)
        if path.suffix.lower() not in _MESHES or not path.is_file():
            raise ValueError(f"person: no mesh {file}; it must be a file that ends in {', '.join(_MESHES)}")
        frame = self._scene.RegisterFrame(self._source, GeometryFrame(name))
        painted = _painted(name, Mesh(MeshSource(path.resolve())), RigidTransform(), colors[_TRUNK])
        try:
            self._scene.RegisterGeometry(self._source, frame, painted)
        except RuntimeError as error:  # it has no normals, for example
            raise ValueError(f"person: the mesh {file} cannot be drawn: {error}") from error
        return [frame]

    def _moving(self, name: str, capsules: Capsules, colors: Sequence[tuple[float, ...]]) -> list[FrameId]:
        frames = []
        parts = zip(capsules.start, capsules.end, capsules.radius, colors, strict=True)
        for k, (start, end, radius, color) in enumerate(parts):
            frame = self._scene.RegisterFrame(self._source, GeometryFrame(f"{name} {k}"))
            length = max(float(np.linalg.norm(end - start)), _SHORTEST)
            shape = Capsule(float(radius), length)
            self._scene.RegisterGeometry(
                self._source, frame, _painted(f"{name} {k}", shape, RigidTransform(), color)
            )
            frames.append(frame)
        return frames


class _Lens:
    """One camera: the pinhole picture that is drawn is a little larger, and the lens bends it."""

    def __init__(self, camera: Cameras, size: tuple[int, int]) -> None:
        width, height = size
        u, v = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
        ideal = camera.undistort(np.stack([u, v], -1).reshape(1, -1, 2))[0]
        low, high = np.floor(ideal.min(axis=0)) - 1.0, np.ceil(ideal.max(axis=0)) + 2.0
        place = (ideal - low).reshape(height, width, 2).astype(np.float32)
        self._u, self._v = np.ascontiguousarray(place[..., 0]), np.ascontiguousarray(place[..., 1])
        fu, fv = camera.focal[0]
        # Drake's pixels begin at their edges, OpenCV's in their middles.
        cu, cv = camera.center[0] - low + 0.5
        info = CameraInfo(int(high[0] - low[0]), int(high[1] - low[1]), fu, fv, cu, cv)
        self.camera = ColorRenderCamera(RenderCameraCore(_ENGINE, info, _CLIPPING, RigidTransform()), False)
        self.X_WC = RigidTransform(RotationMatrix(camera.R_WC[0]), camera.p_WC[0])

    def seen(self, image: np.ndarray) -> np.ndarray:
        return cv2.remap(np.ascontiguousarray(image), self._u, self._v, cv2.INTER_LINEAR)


def _painted(name: str, shape: Shape, X: RigidTransform, color: tuple[float, ...]) -> GeometryInstance:
    found = GeometryInstance(X, shape, name)
    properties = PerceptionProperties()
    properties.AddProperty("phong", "diffuse", Rgba(color[0], color[1], color[2], 1.0))
    properties.AddProperty("label", "id", RenderLabel.kDontCare)
    found.set_perception_properties(properties)
    return found


def _placed(start: np.ndarray, end: np.ndarray) -> RigidTransform:
    """The frame of a capsule: its z axis along it, its origin in its middle."""
    along = end - start
    length = float(np.linalg.norm(along))
    R = RotationMatrix.MakeFromOneVector(along / length, 2) if length > _SHORTEST else RotationMatrix()
    return RigidTransform(R, 0.5 * (start + end))

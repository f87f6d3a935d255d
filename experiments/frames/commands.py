"""``truetip frame``, ``chain``, ``tool`` and ``align``: frames and tools from measurements in text files."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from pydrake.math import RigidTransform

from experiments.cli.console import refusing
from experiments.cli.json_output import human_console
from experiments.cli.options import json_option
from experiments.frames.tables import MM, pose_json, print_facts, print_pose, print_residuals, write_result
from robots.metrology.frame_chain import FrameChain, chain_of_frames
from robots.metrology.frame_files import ORIENTATIONS, points_of, poses_of, transform_of
from robots.metrology.frames import three_point_frame
from robots.metrology.hand_eye import (
    ROTATION_SIGMA,
    TRANSLATION_SIGMA,
    Alignment,
    align_camera,
    align_hand_eye,
)
from robots.metrology.least_squares import UndeterminedError
from robots.metrology.number_table import NumberTable, parse_table, read_table
from robots.metrology.point_registration import register_points
from robots.metrology.tcp_calibration import tool_centre

FilesArgument = Annotated[
    list[Path],
    typer.Argument(
        metavar="FILE...", show_default=False, help="Text files of numbers, a line a point or a pose."
    ),
]
UnitOption = Annotated[str, typer.Option("--unit", metavar="mm|m", help="Unit of the lengths in the files.")]
AnglesOption = Annotated[
    str, typer.Option("--angles", metavar="deg|rad", help="Unit of the angles in the files.")
]
OrientationOption = Annotated[
    str,
    typer.Option(
        "--orientation",
        metavar="NAME",
        help="What follows x, y, z: "
        + "; ".join(f"{name}: {meaning}" for name, meaning in ORIENTATIONS.items())
        + ". Twelve columns are the upper rows of a homogeneous matrix.",
    ),
]
JsonOption = Annotated[str | None, json_option("The result once more; - prints it, and nothing else.")]


def frame_command(files: FilesArgument, unit: UnitOption = "mm", json_file: JsonOption = None) -> None:
    """Frames from measured points, one a file, and where they stand in the first.

    Three numbers a line: the origin, a point on the x axis, one on the y axis and, to check the hand, one
    on the side of positive z. Six: nominal, then measured coordinates, for three or more points; a seventh
    number is the standard deviation of the point.
    """
    console = human_console(json_file)
    poses: list[RigidTransform] = []
    frames: list[dict[str, Any]] = []
    with refusing(ValueError, OSError):
        for table in [read_table(path) for path in files]:
            with _blaming([table]):
                X_DK, facts = _frame(table, unit)
            poses.append(X_DK)
            frames.append({"file": table.name, "pose": pose_json(X_DK), **facts})
        relative = [poses[0].InvertAndCompose(X_DK) for X_DK in poses[1:]]
        write_result({"frames": frames, "in_first_frame": [pose_json(X) for X in relative]}, json_file)
    for X_DK, frame in zip(poses, frames, strict=True):
        print_pose(console, frame["file"], X_DK)
        print_facts(console, frame)
        print_residuals(console, frame)
    for path, X in zip(files[1:], relative, strict=True):
        print_pose(console, f"{path} in {files[0]}", X)


def _frame(table: NumberTable, unit: str) -> tuple[RigidTransform, dict[str, Any]]:
    """The frame of one file, and what is to be said about it."""
    if table.columns == 3:
        if len(table.lines) not in (3, 4):
            raise table.error(
                f"a frame takes three points (origin, x, y) or four (and z), got {len(table.lines)}; for "
                "more, write nominal and measured coordinates, six numbers a line"
            )
        frame = three_point_frame(points_of(table, unit))
        return frame.X_DK, {"skew_deg": np.rad2deg(frame.skew)}
    if table.columns not in (6, 7):
        raise table.error(f"3, 6 or 7 numbers a line describe a frame, got {table.columns}")
    deviations = table.values[:, 6] if table.columns == 7 else np.ones(len(table.lines))
    if not np.all(deviations > 0.0):
        raise table.error(
            "the standard deviation of a point must be positive", np.flatnonzero(deviations <= 0.0)
        )
    weights = np.square(deviations.min() / deviations)
    fit = register_points(points_of(table, unit, slice(0, 3)), points_of(table, unit, slice(3, 6)), weights)
    deviations = fit.statistics.standard_deviations
    return fit.X_DK, {
        "rms_mm": MM * fit.rms,
        "scale": fit.scale,
        "degrees_of_freedom": fit.statistics.degrees_of_freedom,
        "rotation_standard_deviation_deg": np.rad2deg(deviations[:3]),
        "translation_standard_deviation_mm": MM * deviations[3:],
        "outlier_lines": [table.lines[row] for row in fit.statistics.outliers],
        "residual_lines": list(table.lines),
        "residuals_mm": MM * fit.residual,
    }


def chain_command(
    files: FilesArgument,
    unit: UnitOption = "mm",
    is_closed: Annotated[
        bool,
        typer.Option(
            "--closed", help="The chain is closed: the last frame is the first; report the closing error."
        ),
    ] = False,
    json_file: JsonOption = None,
) -> None:
    """A chain of frames measured from several positions of the device: the last frame in the first.

    Two files a position, its first and its second frame, with the points origin, x axis, y axis and, if
    wanted, more; the second frame of a position is the first of the next one. Or one file a transformation,
    with the four lines of its homogeneous matrix.
    """
    console = human_console(json_file)
    with refusing(ValueError, OSError):
        tables = [read_table(path) for path in files]
        with _blaming(tables):
            if all(table.columns == 4 for table in tables):
                chain = FrameChain(tuple(RigidTransform(transform_of(table, unit)) for table in tables))
            else:
                chain = chain_of_frames([points_of(table, unit) for table in tables], is_closed)
        facts: dict[str, Any] = {}
        if is_closed:
            facts["closing_distance_mm"] = MM * chain.closing_distance
            facts["closing_angle_deg"] = np.rad2deg(chain.closing_angle)
        if any(rms is not None for rms in chain.repeat_rms):
            facts["repeat_rms_mm"] = [None if rms is None else MM * rms for rms in chain.repeat_rms]
        links = [pose_json(X) for X in chain.links]
        write_result({"links": links, "chain": pose_json(chain.X_0N), **facts}, json_file)
    for number, X in enumerate(chain.links, 1):
        print_pose(console, f"frame {number} in frame {number - 1}", X)
    print_pose(console, f"the whole chain: frame {len(chain.links)} in frame 0", chain.X_0N)
    print_facts(console, facts)


def tool_command(
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE", show_default=False, help="A text file of numbers, a line a pose."),
    ],
    unit: UnitOption = "mm",
    angles: AnglesOption = "deg",
    orientation: OrientationOption = "ZYX",
    without_outliers: Annotated[bool, typer.Option("--without-outliers", help="Exclude outliers.")] = False,
    json_file: JsonOption = None,
) -> None:
    """The tool centre point by pivoting: the tip stays on one spot, every line is a pose of the flange."""
    console = human_console(json_file)
    with refusing(ValueError, OSError):
        table = read_table(file)
        X_BF = poses_of(table, unit, angles, orientation)
        rows = np.arange(len(X_BF))
        with _blaming([table]):
            tool = tool_centre(X_BF)
            outliers = list(tool.statistics.outliers)
            if without_outliers and outliers:
                rows = np.delete(rows, outliers)
                tool = tool_centre(X_BF[rows])
        half_widths = MM * tool.statistics.half_widths()
        result = {
            "tool_mm": MM * tool.p_FE,
            "tool_confidence_95_mm": half_widths[:3],
            "pivot_mm": MM * tool.p_BP,
            "pivot_confidence_95_mm": half_widths[3:],
            "standard_deviation_of_a_pose_mm": MM * tool.standard_deviation_of_a_pose,
            "standard_deviation_of_a_coordinate_mm": MM * tool.statistics.sigma,
            "degrees_of_freedom": tool.statistics.degrees_of_freedom,
            "outlier_lines": [table.lines[row] for row in outliers],
            "residual_lines": [table.lines[row] for row in rows],
            "residuals_mm": MM * tool.residual,
        }
        write_result(result, json_file)
    print_facts(console, result)
    print_residuals(console, result)


def align_command(
    files: FilesArgument,
    unit: UnitOption = "mm",
    angles: AnglesOption = "deg",
    orientation: OrientationOption = "ZYX",
    body_on_flange: Annotated[
        str | None, typer.Option(metavar="POSE", help="The body on the flange, if known: x;y;z;...")
    ] = None,
    camera_in_base: Annotated[
        str | None, typer.Option(metavar="POSE", help="The camera in the robot's base, if known: x;y;z;...")
    ] = None,
    camera_on_flange: Annotated[
        bool,
        typer.Option(
            "--camera-on-flange",
            help="Hand-eye calibration: the camera is on the flange, the target is fixed.",
        ),
    ] = False,
    rotation_sigma_deg: Annotated[
        float, typer.Option(metavar="DEG", help="Assumed scatter of the camera about an axis.")
    ] = round(np.rad2deg(ROTATION_SIGMA), 9),
    translation_sigma_mm: Annotated[
        float, typer.Option(metavar="MM", help="Assumed scatter of the camera along an axis.")
    ] = MM * TRANSLATION_SIGMA,
    json_file: JsonOption = None,
) -> None:
    """Camera and robot, detection body and flange: where they stand, from pairs of poses.

    A pair is the pose of the flange in the base and, at the same time, that of the body in the camera: both
    in one line of one file, or in corresponding lines of two files.
    """
    console = human_console(json_file)
    sigmas = np.deg2rad(rotation_sigma_deg), translation_sigma_mm / MM
    with refusing(ValueError, OSError):
        flange, body = _two_halves([read_table(path) for path in files])
        X_BF, X_CD = (poses_of(half, unit, angles, orientation) for half in (flange, body))
        given = {"--body-on-flange": body_on_flange, "--camera-in-base": camera_in_base}
        X_FD, X_BC = (
            None if text is None else _single_pose(parse_table(text, name), unit, angles, orientation)
            for name, text in given.items()
        )
        if camera_on_flange and any(given.values()):
            raise ValueError(f"--camera-on-flange cannot be combined with {' or '.join(given)}")
        with _blaming([body]):
            if camera_on_flange:
                # What moves in the camera's eyes is then the base, and what stands still the flange.
                names, alignment = ("body_in_base", "camera_on_flange"), align_hand_eye(X_BF, X_CD, *sigmas)
            else:
                names = ("body_on_flange", "camera_in_base")
                alignment = align_camera(X_BF, X_CD, X_FD, X_BC, *sigmas)
        poses = dict(zip(names, (alignment.X_FD, alignment.X_BC), strict=True))
        result = _alignment(alignment, poses, body)
        write_result(result, json_file)
    for name, X in poses.items():
        print_pose(console, name.replace("_", " "), X)
    print_facts(console, result)
    print_residuals(console, result)


def _alignment(
    alignment: Alignment, poses: Mapping[str, RigidTransform], table: NumberTable
) -> dict[str, Any]:
    """What is to be said about two poses that were found by their names, and about the fit."""
    result: dict[str, Any] = {name: pose_json(X) for name, X in poses.items()}
    deviations = alignment.statistics.standard_deviations.reshape(2, 2, 3)
    for name, (rotation, translation) in zip(poses, deviations, strict=True):
        result[f"{name}_rotation_standard_deviation_deg"] = np.rad2deg(rotation)
        result[f"{name}_translation_standard_deviation_mm"] = MM * translation
    return result | {
        "rotation_rms_deg": np.rad2deg(alignment.rotation_rms),
        "translation_rms_mm": MM * alignment.translation_rms,
        "sigma_over_assumed": alignment.statistics.sigma,
        "degrees_of_freedom": alignment.statistics.degrees_of_freedom,
        "outlier_lines": [table.lines[row] for row in alignment.statistics.outliers],
        "residual_lines": list(table.lines),
        "residuals_mm": MM * alignment.residual[:, 3:],
        "residuals_deg": np.rad2deg(alignment.residual[:, :3]),
    }


def _single_pose(table: NumberTable, unit: str, angles: str, orientation: str) -> RigidTransform:
    (X, *others) = poses_of(table, unit, angles, orientation)
    if others:
        raise table.error(f"one pose expected, got {len(table.lines)}")
    return RigidTransform(X)


def _two_halves(tables: Sequence[NumberTable]) -> tuple[NumberTable, NumberTable]:
    """Flange and body, from the two halves of the lines of one file or from two files."""
    first, *others = tables
    if not others:
        half, odd = divmod(first.columns, 2)
        if odd:
            raise first.error(f"two poses of the same kind in a line expected, got {first.columns} numbers")
        left, right = first.values[:, :half], first.values[:, half:]
        return NumberTable(first.name, left, first.lines), NumberTable(first.name, right, first.lines)
    if len(others) > 1:
        raise ValueError(f"an alignment takes one or two files, got {len(tables)}")
    second = others[0]
    if len(first.lines) != len(second.lines):
        raise second.error(f"{len(second.lines)} poses, but {len(first.lines)} in {first.name}")
    return first, second


@contextmanager
def _blaming(tables: Sequence[NumberTable]) -> Iterator[None]:
    """Says of which lines of which file the mathematics speaks."""
    try:
        yield
    except UndeterminedError as error:
        raise tables[error.part].error(str(error), error.rows) from error

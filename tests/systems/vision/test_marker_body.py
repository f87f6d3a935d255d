"""The detection body: its size, and that no part of it can be taken for another."""

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from systems.vision.data_file import data_file
from systems.vision.marker_body import load_body, smallest_difference
from tests.systems.vision.rigs import BODY

SHIPPED = data_file("probst", "body").read_text()


def test_eleven_spheres_lie_within_350_by_110_mm():
    radius = 0.5 * BODY.diameter
    assert len(BODY) == 11
    assert BODY.diameter == 0.016
    assert np.hypot(*BODY.p_E[:, :2].T).max() + radius <= 0.175
    assert np.ptp(BODY.p_E[:, 2]) + 2.0 * radius <= 0.110


def test_all_distances_differ_by_more_than_measured_ones_can_be_wrong():
    """Points of an unknown scene are known to some tenths of a millimetre."""
    assert smallest_difference(BODY.distances) > 1.7e-3


def test_no_triangle_of_markers_looks_like_another_one():
    triangles = [
        sorted((BODY.distances[i, j], BODY.distances[j, k], BODY.distances[i, k]))
        for i, j, k in combinations(range(len(BODY)), 3)
    ]
    difference = np.abs(np.array(triangles)[:, None] - np.array(triangles)).max(-1)
    assert difference[np.triu_indices(len(triangles), 1)].min() > 1.7e-3


REFUSED = {
    "close": ("- [-92, 16, 110]", "- [-70, 45, 43]", "markers 10 and 11 are 1 mm apart, less than their"),
    "infinite": (
        "- [-131, -81, 123]",
        "- [-131, -81, .inf]",
        r"markers_mm\[0\]\[2\] must be finite, got inf",
    ),
    "decimal comma": ("- [-92, 16, 110]", "- ['-92,0', 16, 110]", "with decimal points, got .'-92,0'"),
    "size": ("marker_diameter_mm: 16", "marker_diameter_mm: 0", "marker_diameter_mm must be positive, got 0"),
}


@pytest.mark.parametrize(("old", "new", "message"), REFUSED.values(), ids=REFUSED)
def test_a_wrong_body_file_is_refused_by_file_and_line(tmp_path: Path, old: str, new: str, message: str):
    file = tmp_path / "body.yaml"
    file.write_text(SHIPPED.replace(old, new))
    with pytest.raises(ValueError, match=message) as error:
        load_body(str(file))
    assert f"{file}, line {1 + SHIPPED[: SHIPPED.index(old)].count(chr(10))}: " in str(error.value)


def test_a_marker_with_two_coordinates_is_refused_by_the_file(tmp_path: Path):
    file = tmp_path / "body.yaml"
    file.write_text(SHIPPED.replace("- [-92, 16, 110]", "- [-92, 16]"))
    with pytest.raises(ValueError, match=r"body\.yaml, line 16: markers_mm must be rows of 3 numbers"):
        load_body(str(file))


def test_markers_on_a_line_are_refused(tmp_path: Path):
    file = tmp_path / "body.yaml"
    file.write_text("markers_mm: [[0, 0, 0], [50, 0, 0], [120, 0, 0], [200, 0, 0]]\n")
    with pytest.raises(ValueError, match="line 1: the 4 markers are collinear"):
        load_body(str(file))


def test_three_markers_are_too_few(tmp_path: Path):
    file = tmp_path / "body.yaml"
    file.write_text("markers_mm: [[0, 0, 0], [100, 0, 0], [0, 50, 0]]\n")
    with pytest.raises(ValueError, match="needs at least 4 markers, got 3"):
        load_body(str(file))

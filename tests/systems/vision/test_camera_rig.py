"""The measuring cell: its cameras look where the source says, and a wrong cell file is refused by name."""

from pathlib import Path

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix

from robots.description.model import load_robot
from robots.kinematics.forward import Kinematics
from systems.reference.paths import ReferenceConfig, make_path
from systems.vision.camera_rig import load_cell
from systems.vision.data_file import data_file
from systems.vision.visibility import in_window
from tests.systems.vision.rigs import BODY, CAMERAS, CELL, placed

SHIPPED = data_file("probst", "cell").read_text()


def test_the_shipped_cell_has_ten_cameras_of_six_megapixels_at_250_hz():
    assert len(CAMERAS) == 10
    assert np.prod(CELL.sensor_px) == pytest.approx(6.1e6, rel=0.01)
    assert CELL.frame_rate_hz == 250


def test_the_flange_in_the_basic_position_is_where_the_source_finds_it_in_the_cameras_frame():
    """Probst (2024), eq. (A.1), its sign of 168 mm corrected."""
    X_BE = RigidTransform(Kinematics(load_robot("irb1200")).forward(np.zeros(6)))
    p_QE = (CELL.base.pose() @ X_BE).translation()
    np.testing.assert_allclose(1e3 * p_QE, [400.0, -168.0, 1289.1], atol=0.05)


def test_cameras_are_level_and_see_the_target_amid_their_windows():
    middle = 0.5 * (CELL.windows[:, :2] + CELL.windows[:, 2:])
    np.testing.assert_allclose(CAMERAS.project(1e-3 * CELL.target_mm), middle, atol=1e-9)
    np.testing.assert_allclose(CAMERAS.R_WC[:, 2, 0], 0.0, atol=1e-12)
    assert np.all(CAMERAS.R_WC[:, 2, 1] < 0.0)  # y of the image is down


def test_the_whole_test_path_lies_in_every_window():
    """So the windows of table A.8, set for the workspace, fit the assumed focal length and aim."""
    path = make_path(ReferenceConfig())
    for X in path.sample(np.linspace(0.0, path.duration, 60))[0]:
        assert in_window(CAMERAS.project(placed(X, BODY.p_E)), CELL.windows).all()


def test_a_cell_moves_with_the_base_of_the_robot():
    X_WB = RigidTransform(RotationMatrix.MakeZRotation(0.7), [0.3, -0.2, 0.1])
    p_B = np.array([[0.4, 0.1, 0.5], [0.6, -0.3, 0.2]])
    moved = CELL.camera_model(X_WB).project(np.array([X_WB.multiply(p) for p in p_B]))
    np.testing.assert_allclose(moved, CAMERAS.project(p_B), atol=1e-8)


def test_a_measured_orientation_is_taken_as_it_is(tmp_path: Path):
    file = tmp_path / "cell.yaml"
    file.write_text(SHIPPED.replace("  window_px: [192,", "  zyx_deg: [0, 0, -90]\n  window_px: [192,"))
    R_QC = CELL.base.pose().rotation().matrix() @ load_cell(str(file)).camera_model().R_WC[0]
    np.testing.assert_allclose(R_QC, [[1, 0, 0], [0, 0, 1], [0, -1, 0]], atol=1e-12)


REFUSED = {
    "singular": ("[3000, 3000]", "[3000, 0]", "camera 01: focal_length_px .* matrix is singular"),
    "window": ("[192, 329, 3071, 1983]", "[192, 329, 3072, 1983]", "camera 01: window_px must lie in 0, 0"),
    "two numbers": ("[1451.98, 1229.47, 3283.72]", "[1451.98, 1229.47]", "position_mm must be 3 numbers"),
    "decimal comma": ("[1451.98, 1229.47, 3283.72]", '["1451,98", 1, 1]', "decimal points, got .'1451,98'"),
    "metres": ("[1451.98, 1229.47, 3283.72]", "[1.45198, 1.22947, 3.28372]", "is it in metres"),
    "rate": ("frame_rate_hz: 250", "frame_rate_hz: 0", "frame_rate_hz must be positive, got 0"),
    "no number": ("radial: [-0.08, 0.02, 0]", "radial: [.nan, 0, 0]", r"radial\[0\] must be finite, got nan"),
    "field": ("sensor_px:", "sensor_size:", "unknown key 'sensor_size'; known here: name, sensor_px"),
    "twice": ("frame_rate_hz: 250", "frame_rate_hz: 250\nname: B", "key 'name' is given twice"),
    "name": ('- name: "02"', '- name: "01"', "two cameras have the name '01'"),
    "mapping": ("target_mm: [450, 0, 450]", "target_mm: {x: 450}", "target_mm must be 3 numbers, got {'x'"),
    "not YAML": ("frame_rate_hz: 250", "frame_rate_hz: 250: 3", "no valid YAML: mapping values are not"),
}


@pytest.mark.parametrize(("old", "new", "message"), REFUSED.values(), ids=REFUSED)
def test_a_wrong_cell_file_is_refused_by_file_and_line(tmp_path: Path, old: str, new: str, message: str):
    file = tmp_path / "cell.yaml"
    file.write_text(SHIPPED.replace(old, new, 1))
    with pytest.raises(ValueError, match=message) as error:
        load_cell(str(file))
    line = 1 + SHIPPED[: SHIPPED.index(old)].count("\n") + new.count("\n")
    assert str(file) in str(error.value)
    assert f"line {line}" in str(error.value)
    assert "\n" not in str(error.value)


def test_an_unknown_cell_is_refused_with_the_names_of_the_shipped_ones():
    with pytest.raises(ValueError, match=r"cell 'nowhere': no file of that name .*one of probst"):
        load_cell("nowhere")

"""A cell as text: it comes back number for number, and with the cameras that were found."""

from pathlib import Path

import numpy as np

from systems.vision.camera_rig import load_cell
from systems.vision.camera_rig_file import cell_text, with_cameras
from tests.systems.vision.rigs import CELL, random_cameras


def test_a_cell_comes_back_as_it_was(tmp_path: Path):
    (tmp_path / "cell.yaml").write_text(cell_text(CELL))
    again = load_cell(str(tmp_path / "cell.yaml"))
    assert cell_text(again) == cell_text(CELL)
    np.testing.assert_array_equal(again.camera_model().R_WC, CELL.camera_model().R_WC)


def test_found_cameras_take_the_place_of_the_others(tmp_path: Path):
    cameras = random_cameras(np.random.default_rng(0), len(CELL.cameras))
    (tmp_path / "cell.yaml").write_text(cell_text(with_cameras(CELL, cameras, "a test")))
    cell = load_cell(str(tmp_path / "cell.yaml"))
    found = cell.camera_model(cell.base.pose())
    for name in ("focal", "center", "radial", "tangential", "R_WC", "p_WC"):
        np.testing.assert_allclose(getattr(found, name), getattr(cameras, name), rtol=1e-12, atol=1e-12)
    assert [camera.name for camera in cell.cameras] == [camera.name for camera in CELL.cameras]
    np.testing.assert_array_equal(cell.windows, CELL.windows)

"""What the page about cameras shows as files is read as such."""

import re
from pathlib import Path

import numpy as np
import pytest

from systems.vision.calibration.observation_file import parse_observations
from systems.vision.camera_rig import load_cell

PAGE = (Path(__file__).resolve().parents[3] / "docs" / "cameras.md").read_text(encoding="utf-8")


def block(beginning: str) -> str:
    """The text of the fenced block that begins so."""
    found = re.search(rf"^```\w*\n({re.escape(beginning)}.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
    assert found
    return found.group(1)


def test_the_cameras_of_the_page_are_aimed_at_their_target(tmp_path: Path):
    (tmp_path / "mine.yaml").write_text(block("name: My cell"))
    cell = load_cell(str(tmp_path / "mine.yaml"))
    # Without a world the base of the robot is its origin.
    pixels = cell.camera_model().project(1e-3 * cell.target_mm)
    # Aimed at means in the middle of the window.
    assert pixels == pytest.approx(0.5 * (cell.windows[:, :2] + cell.windows[:, 2:]), abs=1e-6)


def test_the_observations_of_the_page_are_one_of_the_frame_and_two_of_the_wand():
    run = parse_observations(block("exposure,"), "page", ["01"], frame_points=4)
    assert np.isfinite(run.frame_pixels).any(-1).sum() == 1
    assert np.isfinite(run.wand_pixels).all()

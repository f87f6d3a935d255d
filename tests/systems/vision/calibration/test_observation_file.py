"""Tables of observations: they come back as written, and what is wrong is named with its line."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from systems.vision.calibration.observation_file import (
    observation_text,
    parse_observations,
    read_observations,
)
from systems.vision.calibration.wand import WandRun

NAMES = ["left", "right"]
PIXEL = st.one_of(st.just(np.nan), st.floats(-10.0, 4000.0).map(lambda value: round(value, 5)))


@pytest.mark.slow
@given(arrays(float, (2, 3, 2), elements=PIXEL), arrays(float, (2, 4, 2, 2), elements=PIXEL))
def test_what_was_written_is_read_back(frame: np.ndarray, wand: np.ndarray):
    for pixels in (frame, wand):
        pixels[np.isnan(pixels).any(-1)] = np.nan
    wand = wand[:, ~np.isnan(wand).all((0, 2, 3))]
    if np.isnan(frame).all() and not wand.size:
        return
    exposures = np.where(np.isnan(frame[..., 0]), 0, 1 + np.arange(6).reshape(2, 3))
    text = observation_text(WandRun(frame, exposures, wand), NAMES)
    again = parse_observations(text, "x", NAMES, 3)
    np.testing.assert_array_equal(again.frame_exposures, exposures)
    np.testing.assert_allclose(again.frame_pixels, frame, atol=1e-5)
    np.testing.assert_allclose(again.wand_pixels, wand, atol=1e-5)


def test_pixels_of_the_frame_are_averaged_and_columns_may_stand_in_any_order():
    text = "u_px;v_px;camera;point;exposure\n1;2;left;L2;1\n3;6;left;L2;2\n"
    run = parse_observations(text, "x", NAMES, 3)
    assert run.frame_pixels[0, 1].tolist() == [2.0, 4.0]
    assert run.frame_exposures.tolist() == [[0, 2, 0], [0, 0, 0]]
    assert np.isnan(run.frame_pixels[1]).all()
    assert run.wand_pixels.shape == (2, 0, 2, 2)


def test_a_mean_counts_as_often_as_it_says():
    text = "exposure,camera,point,u_px,v_px,mean_of\n1,left,L1,1,2,9\n2,left,L1,2,3,1\n3,left,A,5,6,1\n"
    run = parse_observations(text, "x", NAMES, 3)
    assert run.frame_pixels[0, 0] == pytest.approx([1.1, 2.1])
    assert run.frame_exposures[0, 0] == 10


HEAD = "exposure,camera,point,u_px,v_px\n"
MEANS = "exposure,camera,point,u_px,v_px,mean_of\n"
REFUSED = {
    "empty": ("", "x: the table is empty"),
    "head only": (HEAD, "x: no observations"),
    "column": ("exposure,camera,point,u_px\n1,left,A,2\n", "x, line 1: needs one column 'v_px'"),
    "camera": (
        HEAD + "1,left,A,2,3\n1,middle,A,2,3\n",
        "x, line 3: camera 'middle' is none of the cell",
    ),
    "point": (HEAD + "1,left,L4,2,3\n", "x, line 2: point 'L4' must be one of A, B, L1, L2, L3"),
    "number": (HEAD + "1,left,A,2,three\n", "x, line 2: v_px must be a finite number .* got 'three'"),
    "infinite": (HEAD + "1,left,A,inf,3\n", "x, line 2: u_px must be a finite number"),
    "decimal comma": (HEAD + "1,left,A,2,5,3\n", "x, line 2: 6 fields, the head has 5"),
    "mean of none": (
        MEANS + "1,left,L1,2,3,0\n",
        "x, line 2: mean_of must be a number of exposures, .* got '0'",
    ),
    "mean of a wand": (
        MEANS + "1,left,A,2,3,4\n",
        "x, line 2: the wand moves, mean_of must be 1 for A, got 4",
    ),
    "twice": (
        HEAD + "1,left,A,2,3\n1,left,A,2,4\n",
        "camera left has seen A in exposure 1 already",
    ),
}


@pytest.mark.parametrize(("text", "message"), REFUSED.values(), ids=REFUSED)
def test_refuses_what_is_wrong_by_its_line(text: str, message: str):
    with pytest.raises(ValueError, match=message):
        parse_observations(text, "x", NAMES, 3)


def test_pixels_outside_the_image_are_refused_where_its_size_is_known():
    text = HEAD + "1,left,A,0,-0.5\n1,left,B,100.5,50\n2,left,A,60,90\n"
    size = np.array([100.0, 60.0])
    with pytest.raises(
        ValueError, match=r"x, line 4: .* image of 100 by 60 px .*, got 60 and 90; are u and v"
    ):
        parse_observations(text, "x", NAMES, 3, size)
    assert parse_observations(text, "x", NAMES, 3).wand_pixels.shape == (2, 2, 2, 2)


def test_refuses_a_file_that_is_not_there():
    with pytest.raises(ValueError, match=r"nowhere\.csv: no such file"):
        read_observations("nowhere.csv", NAMES, 3)

"""Boxes of people from networks: decoded as an independent decoder does, and the robot is nobody."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from systems.vision.people.person_networks import PersonNetwork, covered, darknet_weights, nanodet_boxes
from tests.systems.vision.people.networks import ANCHORS, NET, small_yolo, tiny_yolo, write


def test_the_structure_of_a9_has_as_many_weights_as_published(tmp_path: Path):
    """The published file of 35 434 956 bytes has a header of 20 and four for each weight: 8.8 million."""
    (tmp_path / "net.cfg").write_text(tiny_yolo())
    assert darknet_weights(tmp_path / "net.cfg") == ((35_434_956 - 20) // 4, 416)


def test_boxes_of_a_yolo_are_those_of_an_independent_decoder(tmp_path: Path):
    """Raw outputs of the last convolution: sigmoids of place, confidence and kinds, exp of the size."""
    file = write(tmp_path, small_yolo())
    network = PersonNetwork(file)
    image = np.random.default_rng(0).integers(0, 256, (416, 416, 3), np.uint8)
    found, scores = network._decoded(*network._forward(image))
    raw_net = cv2.dnn.readNetFromDarknet(str(file), str(file.with_suffix(".weights")))
    raw_net.setInput((image[..., ::-1] / np.float32(255.0)).transpose(2, 0, 1)[None].copy())
    last = [name for name in raw_net.getLayerNames() if name.startswith("conv")][-1]
    raw = raw_net.forward(last)[0].reshape(3, 85, 13, 13)
    sigmoid = 1.0 / (1.0 + np.exp(-raw.astype(float)))
    expected, expected_scores = [], []
    for row in range(13):
        for column in range(13):
            for anchor, (width, height) in enumerate(ANCHORS[3:]):
                cell = sigmoid[anchor, :, row, column]
                middle = 32.0 * np.array([column + cell[0], row + cell[1]])
                half = 0.5 * np.array([width, height]) * np.exp(raw[anchor, 2:4, row, column].astype(float))
                expected.append([*(middle - half), *(middle + half)])
                expected_scores.append(cell[4] * cell[5])
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-2)
    # OpenCV sets what lies below its own threshold of 0.2 to zero.
    likely = np.array(expected_scores) > 0.21
    assert likely.sum() > 100
    assert np.ptp(np.array(expected)[:3], axis=0).max() > 100.0  # of three anchors
    np.testing.assert_allclose(scores[likely], np.array(expected_scores)[likely], rtol=1e-3)


def test_weights_that_do_not_fit_their_cfg_are_refused(tmp_path: Path):
    with pytest.raises(ValueError, match=r"needs \d+ weights, .* has \d+"):
        PersonNetwork(write(tmp_path, small_yolo(), missing=5))


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("net.txt", "", "must be .onnx of a NanoDet or .cfg of a YOLO"),
        ("net.cfg", None, "there is no file"),
        ("net.onnx", "no network", "OpenCV cannot run it"),
        ("net.cfg", "[net]\nwidth=416\nheight=320\n", "must be square"),
        ("net.cfg", NET + "[lstm]\n", r"no layer \[lstm\]"),
    ],
)
def test_what_is_no_network_is_refused_in_a_line(tmp_path: Path, name: str, text: str | None, said: str):
    if text is not None:
        (tmp_path / name).write_text(text)
        (tmp_path / "net.weights").write_bytes(bytes(20))
    with pytest.raises(ValueError, match=said) as refused:
        PersonNetwork(tmp_path / name)
    assert "\n" not in str(refused.value)


def test_a_nanodet_says_distances_from_the_middle_of_a_place():
    """At row 2, column 3 of a grid of 4 in 416 px; each side as one sure distance."""
    scores, sides = np.zeros((1, 16, 80)), np.zeros((1, 16, 4, 11))
    place = 2 * 4 + 3
    scores[0, place, 0] = 0.9
    for side, distance in enumerate((1, 2, 0, 3)):
        sides[0, place, side, distance] = 50.0
    boxes, found = nanodet_boxes([scores, sides.reshape(1, 16, 44)], (416, 416))
    step, middle = 104.0, np.array([3.5, 2.5]) * 104.0
    expected = [middle[0] - step, middle[1] - 2 * step, middle[0], middle[1] + 3 * step]
    np.testing.assert_allclose(boxes[place], expected)
    assert found[place] == 0.9
    # As many places over an input that is wider than it is high: row 1, column 3 of 2 by 8.
    wide = nanodet_boxes([scores, sides.reshape(1, 16, 44)], (208, 832))[0][place]
    np.testing.assert_allclose(wide, expected - np.array([0.0, 1.0, 0.0, 1.0]) * step)
    with pytest.raises(ValueError, match="not those of a NanoDet"):
        nanodet_boxes([scores], (416, 416))


def test_a_box_that_shows_the_robot_is_nobody(tmp_path: Path):
    mask = np.zeros((100, 100), np.uint8)
    mask[:, :60] = 1
    assert covered(mask, np.array([0.0, 0.0, 50.0, 100.0])) == 1.0
    assert covered(mask, np.array([40.0, 0.0, 80.0, 100.0])) == 0.5
    network = PersonNetwork(write(tmp_path, small_yolo()))
    image = np.random.default_rng(0).integers(0, 256, (416, 416, 3), np.uint8)
    boxes, _ = network.people(image)
    assert len(boxes)
    assert not len(network.people(image, np.ones((416, 416), np.uint8))[0])

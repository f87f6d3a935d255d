"""``truetip frame``, ``chain``, ``tool`` and ``align``: files in, text and JSON out, refusals by line."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.experiments.commands import refusal, truetip

# Wilms (2016): listings 2 and 3 in m, the links of listing 7 in mm.
LISTING_2, LISTING_3 = "1.01;2;0\n2;2;0\n1;3;0\n", "2;1;0\n2.01;2;0\n1;1;0\n"
LINKS = [
    "0.985230 0.171207 0.003152 -252.307704\n-0.171214 0.985231 0.002277 -174.796067\n"
    "-0.002715 -0.002783 0.999992 0.462192\n0 0 0 1\n",
    "-0.517979 0.855393 -0.000047 236.817210\n-0.855389 -0.517977 0.003032 -234.055211\n"
    "0.002569 0.001611 0.999995 0.353946\n0 0 0 1\n",
    "-0.329056 -0.944310 0.001261 -233.017251\n0.944308 -0.329052 0.002781 79.421043\n"
    "-0.002211 0.002106 0.999995 0.073087\n0 0 0 1\n",
    "0.923591 -0.383376 0.001418 -264.349646\n0.383375 0.923593 0.000398 242.670564\n"
    "-0.001462 0.000176 0.999999 0.445352\n0 0 0 1\n",
]
TOOL, PIVOT = np.array([-1.747805, 44.586360, -87.648108]), np.array([-253.032904, 107.040686, -3.215224])


@pytest.fixture(autouse=True)
def _work_in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")  # Rich wraps at the width of the terminal that runs the tests


def numbers(*arguments: str) -> dict:
    """What a command prints with ``--json -``, which must be all that it prints."""
    result = truetip(*arguments, "--json", "-")
    assert result.exit_code == 0, result.stderr
    return json.loads(result.stdout)


def write(name: str, text: str | np.ndarray) -> str:
    if isinstance(text, np.ndarray):
        text = "\n".join(";".join(f"{value:.12g}" for value in row) for row in text)
    Path(name).write_text(text)
    return name


def columns(X: np.ndarray, lengths: float = 1000.0) -> np.ndarray:
    """Poses (n, 4, 4) in m as x, y, z in mm and ZYX angles in degrees."""
    angles = Rotation.from_matrix(X[:, :3, :3]).as_euler("ZYX", degrees=True)
    return np.hstack([lengths * X[:, :3, 3], angles])


def poses(count: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    X = np.tile(np.eye(4), (count, 1, 1))
    X[:, :3, :3] = Rotation.from_rotvec(rng.uniform(-1.0, 1.0, (count, 3))).as_matrix()
    X[:, :3, 3] = rng.uniform([0.3, -0.3, 0.3], [0.6, 0.3, 0.6], (count, 3))
    return X


def pivot_poses(count: int = 12, noise: float = 0.0) -> np.ndarray:
    """Flange poses, in m, whose tip stands on the pivot of Wilms (2016) but for noise in mm."""
    X = poses(count)
    scatter = noise * np.random.default_rng(1).standard_normal((count, 3))
    X[:, :3, 3] = (PIVOT - X[:, :3, :3] @ TOOL + scatter) / 1000
    return X


def test_two_frames_and_where_the_second_stands_in_the_first():
    files = [write("first.txt", LISTING_2), write("second.txt", LISTING_3)]
    result = numbers("frame", *files, "--unit=m")
    (second,) = result["in_first_frame"]
    assert second["translation_mm"] == pytest.approx([990.0, -1000.0, 0.0], abs=1e-3)
    assert second["zyx_deg"] == pytest.approx([90.0 - np.rad2deg(np.arctan(0.01)), 0.0, 0.0], abs=1e-9)
    assert result["frames"][0]["skew_deg"] == pytest.approx(np.rad2deg(np.arctan(0.01)))
    shown = truetip("frame", *files, "--unit=m").stdout
    assert "second.txt in first.txt" in shown
    assert "-0.999950" in shown


def test_a_frame_by_least_squares_names_the_point_that_was_hit():
    nominal = np.array(
        [[0, 0, 0], [400, 0, 0], [0, 300, 0], [300, 200, 100], [100, 200, 300], [-90, 80, 200.0]]
    )
    R = Rotation.from_euler("ZYX", [30, 20, 10], degrees=True).as_matrix()
    measured = nominal @ R.T + [100, 200, 300] + 0.01 * np.random.default_rng(0).standard_normal((6, 3))
    measured[4, 0] += 1.0
    sigmas = np.full((6, 1), 0.01)
    file = write("points.txt", "# nominal; measured; deviation\n" + write_rows(nominal, measured, sigmas))
    (frame,) = numbers("frame", file)["frames"]
    assert frame["outlier_lines"] == [6]
    assert frame["pose"]["zyx_deg"] == pytest.approx([30, 20, 10], abs=0.3)
    assert frame["degrees_of_freedom"] == 12
    assert "outlier" in truetip("frame", file).stdout


def write_rows(*blocks: np.ndarray) -> str:
    return "\n".join(";".join(map(repr, row)) for row in np.hstack(blocks).tolist())


def test_the_chain_of_wilms_closes_as_he_says():
    files = [write(f"link{number}.txt", text) for number, text in enumerate(LINKS)]
    result = numbers("chain", *files, "--closed")
    assert result["chain"]["translation_mm"] == pytest.approx([-1.205218, 1.215314, -0.128655], abs=2e-4)
    assert result["closing_distance_mm"] == pytest.approx(1.716389, abs=2e-4)
    assert "closing angle deg" in truetip("chain", *files, "--closed").stdout


def test_a_chain_of_sights_leads_to_the_last_frame():
    files = [write("a.txt", LISTING_2), write("b.txt", LISTING_3)]
    assert (
        numbers("chain", *files, "--unit=m")["chain"]
        == numbers("frame", *files, "--unit=m")["in_first_frame"][0]
    )


def test_the_tool_of_wilms_within_its_confidence():
    file = write("pivot.txt", columns(pivot_poses(noise=0.28)))  # s0 of listing 10 is 0.44 mm
    result = numbers("tool", file)
    # Six coordinates at once: twice the interval of a single one is passed once in thousands.
    for found, confidence, truth in (("tool_mm", "tool", TOOL), ("pivot_mm", "pivot", PIVOT)):
        assert np.all(np.abs(result[found] - truth) < 2 * np.array(result[f"{confidence}_confidence_95_mm"]))
    assert result["degrees_of_freedom"] == 30
    assert result["outlier_lines"] == []


def test_the_tool_without_its_outliers():
    X = pivot_poses(noise=0.05)
    X[3, 2, 3] += 0.004
    file = write("pivot.txt", "# x y z alpha beta gamma\n" + write_rows(columns(X)))
    assert numbers("tool", file)["outlier_lines"] == [5]
    result = numbers("tool", file, "--without-outliers")
    assert result["outlier_lines"] == [5]
    assert len(result["residuals_mm"]) == 11
    assert result["tool_mm"] == pytest.approx(TOOL, abs=0.3)


def test_units_and_conventions_change_how_it_is_written_not_what_it_is():
    X = pivot_poses()
    expected = numbers("tool", write("mm.txt", columns(X)))["tool_mm"]
    radians = np.hstack([X[:, :3, 3], Rotation.from_matrix(X[:, :3, :3]).as_euler("xyz")])
    quaternions = np.hstack([X[:, :3, 3], np.roll(Rotation.from_matrix(X[:, :3, :3]).as_quat(), 1, axis=1)])
    metres = ["--unit=m"]
    assert numbers("tool", write("m.txt", X[:, :3].reshape(-1, 12)), *metres)["tool_mm"] == pytest.approx(
        expected
    )
    fixed = numbers("tool", write("rad.txt", radians), *metres, "--angles=rad", "--orientation=xyz")
    assert fixed["tool_mm"] == pytest.approx(expected)
    abb = numbers("tool", write("abb.txt", quaternions), *metres, "--orientation=wxyz")
    assert abb["tool_mm"] == pytest.approx(expected)


@pytest.mark.parametrize("known", [[], ["--body-on-flange"], ["--camera-in-base"]], ids=str)
def test_camera_and_body_are_aligned_with_and_without_a_drawing(known: list[str]):
    X_BF, (X_FD, X_BC) = poses(10), poses(2, seed=1)
    X_CD = np.linalg.inv(X_BC) @ X_BF @ X_FD
    truth = {"--body-on-flange": X_FD, "--camera-in-base": X_BC}
    options = [f"{name}={write_rows(columns(truth[name][None]))}" for name in known]
    both = numbers("align", write("pairs.txt", np.hstack([columns(X_BF), columns(X_CD)])), *options)
    files = [write("flange.txt", columns(X_BF)), write("camera.txt", columns(X_CD))]
    assert both == numbers("align", *files, *options)
    assert both["camera_in_base"]["translation_mm"] == pytest.approx(1000 * X_BC[:3, 3], abs=1e-6)
    assert both["body_on_flange"]["translation_mm"] == pytest.approx(1000 * X_FD[:3, 3], abs=1e-6)


def test_a_camera_on_the_flange():
    X_BF, (X_FC, X_BT) = poses(10), poses(2, seed=1)
    X_CT = np.linalg.inv(X_FC) @ np.linalg.inv(X_BF) @ X_BT
    result = numbers(
        "align", write("pairs.txt", np.hstack([columns(X_BF), columns(X_CT)])), "--camera-on-flange"
    )
    assert result["camera_on_flange"]["translation_mm"] == pytest.approx(1000 * X_FC[:3, 3], abs=1e-6)
    assert result["body_in_base"]["translation_mm"] == pytest.approx(1000 * X_BT[:3, 3], abs=1e-6)


def test_json_in_a_file_is_what_is_printed_without_numbers_that_do_not_exist():
    X_BF, (X_FD, X_BC) = poses(1), poses(2, seed=1)
    pair = np.hstack([columns(X_BF), columns(np.linalg.inv(X_BC) @ X_BF @ X_FD)])
    drawing = f"--body-on-flange={write_rows(columns(X_FD[None]))}"
    shown = truetip("align", write("pair.txt", pair), drawing, "--json=result.json")
    assert "camera in base" in shown.stdout
    result = json.loads(Path("result.json").read_text())
    assert result["camera_in_base_translation_standard_deviation_mm"] == [None] * 3


FILES = {
    "first.txt": LISTING_2,
    "second.txt": LISTING_3,
    "metres.txt": "0;0;0\n0.3;0;0\n0;0.3;0\n",
    "two.txt": "0;0;0\n1;0;0\n",
    "line.txt": "# three points\n0;0;0\n1;0;0\n2;0.01;0\n",
    "left.txt": "0;0;0\n1;0;0\n0;1;0\n0;0;-1\n",
    "german.txt": "1,01,2,0,0,0\n2,0,2,0,0,0\n1,0,3,0,0,0\n",
    "one_axis.txt": "".join(f"100;200;300;{angle};0;0\n" for angle in (0, 30, 60, 90)),
    "alike.txt": "".join(f"100;200;300;{angle};0.3;0.1\n" for angle in (0.1, 0.3, 0.5)),
    "singular.txt": "1 0 0 0\n0 1 0 0\n0 1 0 0\n0 0 0 1\n",
    "sigma.txt": "0;0;0;0;0;0;1\n1;0;0;1;0;0;0\n0;1;0;0;1;0;1\n",
    "mirror.txt": "0;0;0;0;0;0\n1;0;0;1;0;0\n0;1;0;0;1;0\n0;0;1;0;0;-1\n",
}
REFUSED = {
    "no file": (["frame", "nope.txt"], "nope.txt: no such file"),
    "unit": (["frame", "first.txt", "--unit=inch"], "unit must be one of mm, m, got 'inch'"),
    "too few": (["frame", "two.txt", "--unit=m"], "two.txt, lines 1 to 2: a frame takes three points"),
    "metres read as mm": (["frame", "metres.txt"], "metres.txt, line 2: point x is 0.3 mm from the origin"),
    "collinear": (["frame", "line.txt", "--unit=m"], "line.txt, lines 2 to 4: origin, x and y are collinear"),
    "left-handed": (["frame", "left.txt", "--unit=m"], "left.txt, line 4: left-handed"),
    "mirrored": (["frame", "mirror.txt", "--unit=m"], "mirror.txt, lines 1 to 4: left-handed"),
    "decimal commas": (["frame", "german.txt", "--unit=m"], "german.txt, line 1: may be decimal commas"),
    "deviation": (["frame", "sigma.txt", "--unit=m"], "sigma.txt, line 2: the standard deviation of a point"),
    "odd chain": (["chain", "first.txt", "--unit=m"], "an even number, got 1"),
    "singular": (["chain", "singular.txt"], "singular.txt, lines 1 to 3: the rotation matrix is singular"),
    "mixed chain": (["chain", "first.txt", "singular.txt"], "singular.txt, lines 1 to 4: a point takes"),
    "chain": (["chain", "first.txt", "line.txt", "--unit=m"], "line.txt, lines 2 to 4: origin, x and y"),
    "one axis": (["tool", "one_axis.txt"], "one_axis.txt, lines 1 to 4: the flange turns about one axis"),
    "alike": (["tool", "alike.txt"], "alike.txt, lines 1 to 3: the orientations of the flange are"),
    "radians": (["tool", "one_axis.txt", "--angles=rad"], "one_axis.txt, line 2: an angle of 30 rad"),
    "orientation": (["tool", "one_axis.txt", "--orientation=abc"], "orientation must be one of ZYX, XYZ"),
    "odd pair": (["align", "first.txt"], "first.txt, lines 1 to 3: two poses of the same kind in a line"),
    "pairs": (["align", "one_axis.txt", "alike.txt"], "alike.txt, lines 1 to 3: 3 poses, but 4 in one"),
    "three files": (["align", "first.txt", "first.txt", "first.txt"], "takes one or two files, got 3"),
    "drawing": (["align", "alike.txt", "alike.txt", "--camera-in-base=1;2;3"], "--camera-in-base, line 1: "),
    "sigma": (["align", "alike.txt", "alike.txt", "--rotation-sigma-deg=0"], "sigmas must be positive"),
    "json": (["frame", "first.txt", "--unit=m", "--json=."], "it is a folder"),
}  # fmt: skip


@pytest.mark.parametrize(("arguments", "reason"), REFUSED.values(), ids=REFUSED.keys())
def test_bad_input_is_refused_in_one_line(arguments: list[str], reason: str):
    for file, text in FILES.items():
        write(file, text)
    assert reason in refusal(truetip(*arguments))

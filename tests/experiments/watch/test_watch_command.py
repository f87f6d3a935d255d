"""``truetip watch`` on recorded images: who is seen in them, cameras that end, and what is refused."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from experiments.watch import run as watch_run
from experiments.watch.recording import COLUMNS, Recording
from systems.cell.overview.person import gap
from tests.experiments.commands import files, refusal, truetip
from tests.systems.vision.people.networks import small_yolo, write
from tests.systems.vision.people.rigs import ARMS, CELL, detector, painted, person_at

SMALL = ["--set=station.overview.width=320", "--set=servo.people.hull.edge=0.1"]
NAMES = [camera.name for camera in CELL.cameras]
PERSON = person_at(1.3, 0.5)
EMPTY, SETS = 3, 6


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> Path:
    """Three sets of the empty cell, then three with a person; the second camera ends early."""
    folder, rng = tmp_path_factory.mktemp("recording"), np.random.default_rng(1)
    rows = [",".join(COLUMNS)]
    sets = [painted(PERSON if n >= EMPTY else None, ARMS[n % EMPTY], rng) for n in range(SETS)]
    for number, images in enumerate(sets):
        rows.append(",".join([f"{0.1 * number:.2f}", *(f"{q:.4f}" for q in ARMS[number % EMPTY])]))
        for name, image in zip(NAMES, images, strict=True):
            if name != NAMES[1] or number < SETS - 1:
                (folder / name).mkdir(exist_ok=True)
                cv2.imwrite(str(folder / name / f"{number:03}.png"), image)
    (folder / "joints.csv").write_text("\n".join(rows))
    return folder


def watch(folder: Path, out: Path, *more: str):
    return truetip(
        "watch", "--images", folder, "--empty", EMPTY, *SMALL, "--report", out / "watch.html", *more
    )


def video_of(path: Path, frames: list[np.ndarray]) -> Path:
    height, width, _ = frames[0].shape
    video = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 20.0, (width, height))
    for frame in frames:
        video.write(frame)
    video.release()
    return path


@pytest.mark.slow
def test_a_person_in_a_recording_stops_the_robot_and_the_page_shows_where(recording: Path, tmp_path: Path):
    network = write(tmp_path, small_yolo())
    options = ["--network", str(network), "--set=servo.people.lasting=0.15"]
    result = watch(recording, tmp_path, "--json", str(tmp_path / "watch.json"), *options)
    assert result.exit_code == 0, result.output
    numbers = json.loads((tmp_path / "watch.json").read_text())
    (change,) = numbers["changes"]
    assert change["since_s"] == pytest.approx(0.1 * EMPTY)
    assert np.linalg.norm(np.array(change["place_m"][:2]) - [1.3, 0.5]) < 0.3
    assert "Changes of the cell that stay" in (tmp_path / "watch.html").read_text(encoding="utf-8")
    assert 0 <= numbers["confirmed_by_cameras"] <= len(NAMES)
    true = min(gap(PERSON, detector().arm.at(q)) for q in ARMS)
    assert true - 0.4 < numbers["smallest_distance_m"] < true + 0.1
    assert numbers["stopped_s"] > 0.0
    assert numbers["notes"] == [f"camera {NAMES[1]} ended after {SETS - 1} sets"]
    assert f"Note: {numbers['notes'][0]}" in result.stdout
    page = (tmp_path / "watch.html").read_text()
    assert "not a safety function" in page
    assert page.count("data:image/jpeg") == 6  # two of them of the change
    assert "not a safety function" in " ".join(result.stdout.split())


def test_a_single_video_has_all_cameras_side_by_side_and_row_by_row(tmp_path: Path):
    """Three cameras in two rows of two; the fourth place is nobody's. JPEG changes levels a little."""
    greys = np.array([[40, 80, 120], [60, 100, 140]])
    frames = [np.zeros((96, 128, 3), np.uint8) for _ in greys]
    for frame, grey in zip(frames, greys, strict=True):
        frame[:48, :64], frame[:48, 64:], frame[48:, :64] = grey[0], grey[1], grey[2]
    video_of(tmp_path / "all.avi", frames)
    rows = [",".join(map(str, [0.05 * number, *np.zeros(6)])) for number in range(3)]
    (tmp_path / "all.csv").write_text("\n".join([",".join(COLUMNS), *rows]))
    recording = Recording(tmp_path / "all.avi", ["a", "b", "c"])
    means = [images.mean(axis=(1, 2, 3)) for images in recording.sets((64, 48))]
    np.testing.assert_allclose(means, [*greys, [0, 0, 0]], atol=4.0)
    assert recording.ended == {"a": 2, "b": 2, "c": 2}
    with pytest.raises(ValueError, match="must be made of 3 images of 60 x 48 px, got 128 x 96 px"):
        next(recording.sets((60, 48)))
    (tmp_path / "all.csv").write_text("\n".join([",".join(COLUMNS), *rows[:2]]))
    more = video_of(tmp_path / "all.avi", [np.full((96, 128, 3), 90, np.uint8)] * 3)
    recording = Recording(more, ["a", "b", "c"])
    assert len(list(recording.sets((64, 48)))) == 2
    assert recording.notes == ["1 image of all.avi is beyond the last line of all.csv and left out"]


def test_videos_are_read_image_by_image_and_end_when_they_end(tmp_path: Path):
    video_of(tmp_path / "left.avi", [np.full((48, 64, 3), grey, np.uint8) for grey in (40, 80, 120)])
    rows = [",".join(map(str, [0.05 * number, *np.zeros(6)])) for number in range(4)]
    (tmp_path / "joints.csv").write_text("\n".join([",".join(COLUMNS), *rows]))
    recording = Recording(tmp_path, ["left"])
    means = [images.mean() for images in recording.sets((64, 48))]
    np.testing.assert_allclose(means, [40, 80, 120, 0], atol=2.0)
    assert recording.ended == {"left": 3}
    assert recording.notes == ["camera left ended after 3 sets"]
    (tmp_path / "joints.csv").write_text("\n".join([",".join(COLUMNS), *rows[:2]]))
    recording = Recording(tmp_path, ["left"])
    assert len(list(recording.sets((64, 48)))) == 2
    assert recording.notes == ["1 image of camera left is beyond the last line of joints.csv and left out"]


def test_a_folder_without_a_recording_is_refused_before_the_cell_is_built(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(watch_run, "watched_cell", lambda *_: pytest.fail("the cell was built"))
    empty, out = tmp_path / "empty", tmp_path / "out"
    for folder in (empty, out):
        folder.mkdir()
    assert "joints.csv: no such file or directory" in refusal(watch(empty, out))
    (empty / "joints.csv").write_text(",".join(COLUMNS) + "\n" + "0,0,0,0,0,0,0\n1,0,0,0,0,0,0\n")
    assert f"no pictures of camera {NAMES[0]}" in refusal(watch(empty, out))


def test_pictures_are_read_in_the_order_of_their_numbers(tmp_path: Path):
    (tmp_path / "left").mkdir()
    for number in range(1, 12):
        grey = np.full((48, 64, 3), 20 * number, np.uint8)
        cv2.imwrite(str(tmp_path / "left" / f"set{number}.png"), grey)
    rows = [",".join(map(str, [0.05 * number, *np.zeros(6)])) for number in range(11)]
    (tmp_path / "joints.csv").write_text("\n".join([",".join(COLUMNS), *rows]))
    means = [images.mean() for images in Recording(tmp_path, ["left"]).sets((64, 48))]
    assert means == [20.0 * number for number in range(1, 12)]


def test_pictures_beyond_the_last_line_of_joints_are_counted(tmp_path: Path):
    for name, pictures in (("left", 5), ("right", 2), ("top", 5)):
        (tmp_path / name).mkdir()
        for number in range(pictures):
            cv2.imwrite(str(tmp_path / name / f"{number}.png"), np.zeros((48, 64, 3), np.uint8))
    rows = [",".join(map(str, [0.05 * number, *np.zeros(6)])) for number in range(2)]
    (tmp_path / "joints.csv").write_text("\n".join([",".join(COLUMNS), *rows]))
    recording = Recording(tmp_path, ["left", "right", "top"])
    assert len(list(recording.sets((64, 48)))) == 2
    beyond = "are beyond the last line of joints.csv and left out"
    assert recording.notes == [f"3 images of camera {name} {beyond}" for name in ("left", "top")]


@pytest.mark.parametrize(("period", "said"), [(20.0, "20 s apart"), (50.0, "50 s apart")])
def test_times_in_milliseconds_are_refused_with_a_hint(tmp_path: Path, period: float, said: str):
    """A pause in which nothing was recorded says nothing of the unit."""
    (tmp_path / "left").mkdir()
    (tmp_path / "left" / "1.png").touch()
    for unit in (1.0, 1e-3):
        times = unit * (period * np.arange(6) + [0, 0, 0, 0, 9000.0, 9000.0])
        rows = [f"{time:g},0,0,0,0,0,0" for time in times]
        (tmp_path / "joints.csv").write_text("\n".join([",".join(COLUMNS), *rows]))
        if unit == 1.0:
            with pytest.raises(ValueError, match=f"joints.csv: sets of images are {said}.* in ms"):
                Recording(tmp_path, ["left"])
        else:
            assert len(Recording(tmp_path, ["left"])) == 6


def test_joints_in_degrees_are_refused_before_the_cell_is_built(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(watch_run, "watched_cell", lambda *_: pytest.fail("the cell was built"))
    for name in NAMES:
        (tmp_path / name).mkdir()
        (tmp_path / name / "1.png").touch()
    rows = [f"{0.1 * number:g},0,30,0,-80.5,0,0" for number in range(5)]
    (tmp_path / "joints.csv").write_text("\n".join([",".join(COLUMNS), *rows]))
    said = refusal(watch(tmp_path, tmp_path))
    assert f"{tmp_path}/joints.csv: q4_rad of set 1 is -80.5, its range is -4.712 to 4.712 rad" in said


@pytest.mark.slow
def test_what_is_wrong_with_a_recording_is_said_in_one_line(recording: Path, tmp_path: Path):
    broken, out = tmp_path / "broken", tmp_path / "out"
    out.mkdir()
    broken.mkdir()
    assert "joints.csv: no such file or directory" in refusal(watch(broken, out))
    joints = (recording / "joints.csv").read_text().splitlines()
    (broken / "joints.csv").write_text("\n".join(joints))
    assert f"no pictures of camera {NAMES[0]}" in refusal(watch(broken, out))
    for name in NAMES:
        (broken / name).mkdir()
        cv2.imwrite(str(broken / name / "1.png"), np.zeros((10, 20, 3), np.uint8))
    assert "images must be 320 x 207 px, got 20 x 10 px" in refusal(watch(broken, out))
    (broken / "joints.csv").write_text("\n".join([*joints[:2], joints[2].replace("0.10", "soon", 1)]))
    assert "line 3: time_s is not a finite number, got 'soon'" in refusal(watch(broken, out))
    assert files(out) == set()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--study", "--places", "0"], "--places must be at least 1, got 0"),
        (["--study", "--images", "x"], "--study draws its own images"),
        (["--images", "none"], "--images none: must be a folder with joints.csv"),
        (["--study", "--minutes", "-1"], "--minutes must be zero or positive, got -1"),
        (["--study", "--minutes", "nan"], "--minutes must be zero or positive, got nan"),
        (["--places", "3"], "--places has no effect without --study"),
        (["--empty", "3"], "--empty has no effect with simulated images"),
        (["--scenario", "nominal"], "takes images of the whole cell; use --scenario watched"),
    ],
)
def test_wrong_arguments_are_refused_in_one_line(
    arguments: list[str], message: str, tmp_path: Path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    assert message in refusal(truetip("watch", *SMALL, *arguments))
    assert files(tmp_path) == set()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--network", "net.onnx"], "there is no file net.onnx"),
        (["--network", "net.onnx", "--study"], "--study is of the hull alone"),
    ],
)
def test_a_network_that_is_not_there_or_has_no_use_is_refused(arguments: list[str], said: str):
    assert said in refusal(truetip("watch", *arguments))

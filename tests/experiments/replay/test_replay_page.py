"""The replay as a reader uses it: what it shows, its controls and its keys."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from experiments.metrics.run_metrics import pose_errors
from experiments.replay.replay import watchers, write_replay
from experiments.replay.replay_data import frame_times, replay_data
from experiments.report.style import law_title
from robots.description.model import load_robot
from robots.description.pictures.picture import Picture
from robots.kinematics.forward import Kinematics
from systems.cell.marker_camera import MarkerFeaturesConfig
from tests.experiments.browser_session import browser
from tests.experiments.report.test_curves import decoded
from tests.experiments.synthetic import comparison

pytestmark = pytest.mark.real_time


@pytest.fixture(scope="module")
def logs():
    return {law: cycles[0] for law, cycles in comparison(with_joints=True).items()}


def test_wanted_position_and_deviation_together_are_the_true_position(logs):
    data = replay_data(logs, "pbvs")
    log = logs["pbvs"]
    rows = np.searchsorted(log.time, frame_times(log))
    law = next(each for each in data["laws"] if each["id"] == "pbvs")
    wanted = np.stack([decoded(axis) for axis in data["wanted"]], -1)
    deviation = np.stack([decoded(axis) for axis in law["deviation"]], -1)
    assert wanted + deviation == pytest.approx(log.X_WE_true[rows, :3, 3], abs=1e-5)
    distance = 1e3 * np.linalg.norm(pose_errors(log, "true")[rows, 3:], axis=1)
    assert decoded(law["mm"]) == pytest.approx(distance, rel=1e-3)


def test_cameras_and_markers_of_a_camera_system_are_seen():
    seen = watchers(MarkerFeaturesConfig(), load_robot("irb1200"))
    assert seen.cameras.shape == (10, 4, 4)
    assert seen.markers.shape == (11, 3)
    # They look at the robot.
    towards = np.array([0.4, 0.0, 0.4]) - seen.cameras[:, :3, 3]
    assert (np.einsum("ni,ni->n", seen.cameras[:, :3, 2], towards) > 0.0).all()


@pytest.mark.slow
def test_controls_and_keys_do_what_they_say(logs, tmp_path):
    page = tmp_path / "replay.html"
    write_replay(page, load_robot("irb1200"), logs, shown_law="pbvs")
    assert page.stat().st_size < 5e6
    with browser() as tab:
        tab.view(1280, 720)
        tab.open(page)
        frame = "Number(document.getElementById('slider').value)"
        press = "document.dispatchEvent(new KeyboardEvent('keydown', {{key: '{}', shiftKey: {}}}))"
        painted = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"

        def keys(*names: str, shift: str = "false") -> float:
            for name in names:
                tab.run(press.format(name, shift))
            tab.run(painted)
            return tab.run(frame)

        last = tab.run("count - 1")
        assert keys("End") == last
        assert keys("Home") == 0
        assert keys("ArrowRight", "ArrowRight", "ArrowLeft") == 1
        assert keys("ArrowRight", shift="true") == 61  # a second at 60 frames per second
        mm = float(tab.run("document.querySelector('tr[data-law=pbvs] .mm').textContent"))
        log = logs["pbvs"]
        row = int(np.searchsorted(log.time, frame_times(log)[61]))
        assert mm == pytest.approx(1e3 * np.linalg.norm(pose_errors(log, "true")[row, 3:]), rel=2e-3)
        # The trail is the wanted path with the magnified deviation.
        tab.run("element('magnify').value = 1000; element('magnify').dispatchEvent(new Event('change'))")
        law = "laws.find(each => each.id === 'pbvs')"
        moved = tab.run(f"{law}.trail.geometry.attributes.position.getX(61) - wanted[0][61]")
        assert moved == pytest.approx(1000.0 * tab.run(f"{law}.deviation[0][61]"), rel=1e-4)
        keys("2")
        assert tab.run("document.querySelector('[data-view=tool]').getAttribute('aria-pressed')") == "true"
        tab.run("document.querySelector('button[data-law=open_loop]').click()")
        tab.run(painted)
        assert not tab.run("laws.find(each => each.id === 'open_loop').trail.visible")
        keys(" ")
        assert tab.run("new Promise(done => setTimeout(done, 700))") is None
        assert tab.run("state.frame") > 61  # it plays
        assert not tab.complaints
        assert all(address.startswith(("file:", "data:", "blob:")) for address in tab.requests)
        assert all(law_title(law) in tab.run("document.body.textContent") for law in logs)


# The corners of the first shape of the last link in the world, as three.js draws them.
CORNERS = """(() => {
  show();
  scene.updateMatrixWorld(true);
  const link = laws.find(each => each.id === "pbvs").arm.joints[5].link, mesh = link.children[0];
  const places = mesh.geometry.attributes.position, found = [];
  for (let i = 0; i < places.count; i++)
    found.push(new THREE.Vector3().fromBufferAttribute(places, i).applyMatrix4(mesh.matrixWorld).toArray());
  return found;
})()"""


@pytest.mark.slow
def test_a_page_with_fine_meshes_is_small_and_draws_them_where_the_robot_is(logs, tmp_path: Path):
    """Angles have steps of 1/200000 and corners of 1/20000 of the largest: some micrometres at the tip."""
    trimesh.creation.icosphere(subdivisions=6, radius=0.12).export(tmp_path / "ball.stl")  # 81,920 faces
    box = trimesh.creation.box((0.04, 0.08, 0.2))
    box.export(tmp_path / "hand.obj")
    robot = load_robot("irb1200")
    for link in robot.links[:5]:
        link.pictures = [Picture("mesh", str(tmp_path / "ball.stl"))]
    robot.links[5].pictures = [Picture("mesh", str(tmp_path / "hand.obj"))]
    page = tmp_path / "replay.html"
    write_replay(page, robot, logs, shown_law="pbvs")
    assert page.stat().st_size < 5e6
    log = logs["pbvs"]
    X_WF = Kinematics(robot).forward(log.link_position[-1]) @ robot.tool.pose().inverse().GetAsMatrix4()
    expected = (X_WF @ np.c_[box.vertices, np.ones(8)].T)[:3].T
    with browser() as tab:
        tab.view(1280, 720)
        tab.open(page)
        tab.run("document.dispatchEvent(new KeyboardEvent('keydown', {key: 'End'}))")
        corners = np.array(tab.run(CORNERS))
        assert corners.shape == (36, 3)  # of twelve triangles
        apart = np.linalg.norm(corners[:, None] - expected, axis=-1)
        assert apart.min(axis=1).max() < 5e-5
        assert apart.min(axis=0).max() < 5e-5
        tab.picture(tmp_path / "replay.png")
        assert not tab.complaints

"""The replay draws in Chromium without a graphics card; what a frame costs is printed (`pytest -s`).

Frames a second on a machine with other work say little, and so do processor times on threads of one core.
Two free cores draw 30 frames a second if a frame takes less than two thirtieths of a second of all threads
together, and less than a thirtieth of the busiest one.
"""

import os
import time
from pathlib import Path

import pytest

from experiments.replay.replay import write_replay
from robots.description.model import load_robot
from tests.experiments.browser_session import browser
from tests.experiments.synthetic import comparison

pytestmark = [pytest.mark.slow, pytest.mark.real_time]

WATCHED = 4.0  # s
SESSION, USER, SYSTEM = 3, 11, 12  # places in a line of /proc/PID/stat behind the name
RENDERER = """(() => {
  const gl = document.querySelector("canvas").getContext("webgl2");
  return gl.getParameter(gl.getExtension("WEBGL_debug_renderer_info").UNMASKED_RENDERER_WEBGL);
})()"""


def stat(file: Path) -> list[str]:
    return file.read_text().rsplit(")", 1)[1].split()


def thread_seconds(session: int) -> dict[str, float]:
    """The processor time of all threads of a session of processes in s."""
    found = {}
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if int(stat(process / "stat")[SESSION]) != session:
                continue
            for thread in (process / "task").iterdir():
                fields = stat(thread / "stat")
                ticks = int(fields[USER]) + int(fields[SYSTEM])
                found[thread.name] = ticks / os.sysconf("SC_CLK_TCK")
        except (FileNotFoundError, ProcessLookupError):
            continue  # it has ended meanwhile
    return found


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="reads processor times from /proc")
@pytest.mark.parametrize("robots", ["pbvs", "all"])
def test_it_goes_on_drawing_without_a_graphics_card(tmp_path: Path, robots: str):
    page = tmp_path / "replay.html"
    logs = {law: cycles[0] for law, cycles in comparison(with_joints=True).items()}
    write_replay(page, load_robot("irb1200"), logs, shown_law="pbvs")
    with browser() as tab:
        tab.view(1280, 720)
        tab.open(page)
        assert "SwiftShader" in tab.run(RENDERER)
        tab.run(f"element('robot').value = '{robots}'; element('robot').dispatchEvent(new Event('change'))")
        tab.run("new Promise(done => setTimeout(done, 5000))")  # in which it finds how fine it can draw
        frames, before = tab.run("window.replayFrames"), thread_seconds(tab.process)
        started = time.monotonic()
        time.sleep(WATCHED)
        drawn = tab.run("window.replayFrames") - frames
        fineness = tab.run("fineness")
        seconds, after = time.monotonic() - started, thread_seconds(tab.process)
    spent = [used - before.get(thread, 0.0) for thread, used in after.items()]
    print(
        f"\nreplay, {robots}: {drawn / seconds:.0f} frames a second at a load of {os.getloadavg()[0]:.1f}, "
        f"{fineness:.2f} pixels for one of the screen along a side; "
        f"a frame takes {1e3 * sum(spent) / drawn:.0f} ms, {1e3 * max(spent) / drawn:.0f} of them one thread"
    )
    assert drawn > 0

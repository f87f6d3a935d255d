"""What is recorded can be watched: a client of Foxglove's protocol gets the messages of the record."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from diagrams.record.foxglove_server import SCENE, FoxgloveServer
from diagrams.record.read_record import read_record
from diagrams.record.run_record import RunRecord, write_tick
from diagrams.record.topics import SCHEMAS
from robots.description.model import load_robot

websocket = pytest.importorskip("websocket")
pytest.importorskip("foxglove")
ROBOT = load_robot("irb1200")
NOTHING = np.zeros(6)


@pytest.fixture
def server():
    server = FoxgloveServer("0", ROBOT)
    yield server
    server.close()


def subscribed(server, topics: set[str]):
    """A client that has subscribed to topics, and the names of the topics by its subscriptions."""
    client = websocket.create_connection(server.address, subprotocols=["foxglove.sdk.v1"], timeout=5.0)
    assert json.loads(client.recv())["op"] == "serverInfo"
    found: dict[str, int] = {}
    while not topics <= set(found):
        found |= {each["topic"]: each["id"] for each in json.loads(client.recv())["channels"]}
    rows = [{"id": n, "channelId": found[topic]} for n, topic in enumerate(sorted(topics))]
    client.send(json.dumps({"op": "subscribe", "subscriptions": rows}))
    return client, dict(enumerate(sorted(topics)))


def test_a_viewer_gets_what_the_record_gets(server, tmp_path):
    record = RunRecord(tmp_path / "run.mcap", "", server)
    write_tick(record, 0.0, 0.0, (NOTHING, NOTHING), (NOTHING, NOTHING), NOTHING, np.eye(4))
    client, names = subscribed(server, {"/joint_sample", "/scene"})
    got: dict[str, list[bytes]] = {name: [] for name in names.values()}
    tick = 0
    # A subscription needs a moment; from then on nothing is missing.
    while len(got["/joint_sample"]) < 30 or not got["/scene"]:
        tick += 1
        q = np.full(6, 0.001 * tick)
        write_tick(record, 0.004 * tick, 0.0, (q, NOTHING), (q, NOTHING), NOTHING, np.eye(4))
        client.settimeout(0.01)
        try:
            while True:
                data = client.recv()
                assert data[0] == 1  # a message: its subscription and time follow
                got[names[int.from_bytes(data[1:5], "little")]].append(data[13:])
        except websocket.WebSocketTimeoutException:
            pass
        assert tick < 500
    client.close()
    record.close()
    positions = np.array([json.loads(each)["position"] for each in got["/joint_sample"]])
    recorded = read_record(tmp_path / "run.mcap").topics["/joint_sample"].columns["position"]
    first = int(np.argmin(np.abs(recorded[:, 0] - positions[0, 0])))
    np.testing.assert_array_equal(positions, recorded[first : first + len(positions)])
    assert b"robot" in got["/scene"][-1]


def test_an_address_is_a_port_and_perhaps_a_host(server):
    assert server.address.startswith("ws://127.0.0.1:")
    for wrong in ("here", "127.0.0.1", "99999", ":"):
        with pytest.raises(ValueError, match=r"--foxglove must be PORT or HOST:PORT, got"):
            FoxgloveServer(wrong, ROBOT)
    with pytest.raises(OSError, match=r"--foxglove 127\.0\.0\.1:\d+: .*in use"):
        FoxgloveServer(server.address.rpartition(":")[2], ROBOT)


def test_the_layout_shows_topics_that_there_are():
    layout = json.loads((Path(__file__).parents[3] / "docs" / "foxglove-layout.json").read_text())
    panels = layout["configById"].values()
    paths = [row["value"] for panel in panels for row in panel.get("paths", [])]
    paths += [topic for panel in panels for topic in panel.get("topics", [])]
    assert {re.split(r"[.\[]", path)[0] for path in paths} <= {*SCHEMAS, SCENE}
    assert len(paths) > 15

"""The command StreamFrames: written and read alike, in any case, and refused where a server would."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from systems.link.qualisys.messages import Component
from systems.link.qualisys.stream_request import RequestError, StreamRequest, parse_components

RATES = st.one_of(
    st.just({}),
    st.builds(lambda n: {"frequency": n}, st.integers(1, 10_000)),
    st.builds(lambda n: {"divisor": n}, st.integers(1, 1000)),
)
WAYS = st.one_of(
    st.just({}),
    st.builds(lambda port: {"udp_port": port}, st.integers(1023, 65535)),
    st.builds(lambda port: {"udp_port": port, "udp_address": "127.0.0.1"}, st.integers(1023, 65535)),
)
COMPONENTS = st.sampled_from(
    [(Component.POSE,), (Component.POSE_RESIDUAL,), (Component.POSE, Component.POSE_RESIDUAL)]
)


@given(RATES, WAYS, COMPONENTS, st.sampled_from([str, str.lower, str.upper]))
def test_what_is_asked_for_is_understood_in_any_case(rate: dict, way: dict, components: tuple, case):
    request = StreamRequest(components, **rate, **way)
    command, *words = case(request.command()).split()
    assert command.lower() == "streamframes"
    assert StreamRequest.parse(words) == request


def test_components_without_poses_are_known_but_not_served():
    assert parse_components(["3D", "6D", "Analog:1,2-4", "6D"]) == (Component.POSE,)
    assert parse_components(["all"]) == (Component.POSE, Component.POSE_RESIDUAL)


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("", "is none of AllFrames, Frequency:n"),
        ("sometimes 6D", "'sometimes' is none of"),
        ("Frequency:0 6D", "is none of"),
        ("Frequency:-1 6D", "is none of"),
        ("Frequency:²  6D", "is none of"),
        ("AllFrames", "a component is needed"),
        ("AllFrames 7D", "not a component: 7d"),
        ("AllFrames UDP:22 6D", "with a port of 1023 to 65535"),
        ("AllFrames UDP:65536 6D", "with a port of 1023 to 65535"),
        ("AllFrames UDP:a:b:2222 6D", "is not UDP:port"),
    ],
)
def test_what_no_server_understands_is_refused(command: str, message: str):
    with pytest.raises(RequestError, match=message):
        StreamRequest.parse(command.split())

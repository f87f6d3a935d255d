"""Inverse models that run beside a law: what the robot needs to follow without waiting for an error."""

from systems.feedforward.feedforward import Feedforward, FeedforwardConfig
from systems.feedforward.flexible_joint import FlexibleJointFeedforward
from systems.feedforward.rigid import RigidFeedforward

FEEDFORWARDS: dict[str, type[Feedforward]] = {
    "rigid": RigidFeedforward,
    "flexible_joint": FlexibleJointFeedforward,
}

__all__ = ["FEEDFORWARDS", "Feedforward", "FeedforwardConfig", "FlexibleJointFeedforward", "RigidFeedforward"]

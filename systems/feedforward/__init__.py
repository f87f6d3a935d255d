"""Inverse models that run beside a law: what the robot needs to follow without waiting for an error."""

from systems.feedforward.config import FeedforwardConfig
from systems.feedforward.elastic_structure import ElasticStructureFeedforward
from systems.feedforward.feedforward import Feedforward
from systems.feedforward.flexible_joint import FlexibleJointFeedforward
from systems.feedforward.joint_motion import JointReference
from systems.feedforward.rigid import RigidFeedforward

FEEDFORWARDS: dict[str, type[Feedforward]] = {
    "rigid": RigidFeedforward,
    "flexible_joint": FlexibleJointFeedforward,
    "elastic_structure": ElasticStructureFeedforward,
}

__all__ = [
    "FEEDFORWARDS",
    "ElasticStructureFeedforward",
    "Feedforward",
    "FeedforwardConfig",
    "FlexibleJointFeedforward",
    "JointReference",
    "RigidFeedforward",
]

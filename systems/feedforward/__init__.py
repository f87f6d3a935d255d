"""Inverse models that run beside a law: what the robot needs to follow without waiting for an error."""

from systems.feedforward.config import FeedforwardConfig
from systems.feedforward.joint_motion import JointReference
from systems.named_classes import NamedClasses

FEEDFORWARDS = NamedClasses(
    "feedforward",
    {
        "rigid": "systems.feedforward.rigid:RigidFeedforward",
        "flexible_joint": "systems.feedforward.flexible_joint:FlexibleJointFeedforward",
        "elastic_structure": "systems.feedforward.elastic_structure:ElasticStructureFeedforward",
        "corrected": "systems.feedforward.corrected_inverse.corrected:CorrectedFeedforward",
        "stable": "systems.feedforward.stable_inverse.stable:StableFeedforward",
    },
)

__all__ = ["FEEDFORWARDS", "FeedforwardConfig", "JointReference"]

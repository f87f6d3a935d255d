"""Stamped samples as plain vectors, for Drake's vector logs."""

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from robots.model import NUM_JOINTS
from systems.samples import JointSample, PoseSample

JOINT_WIDTH = 1 + 3 * NUM_JOINTS  # time, position, velocity, effort
POSE_WIDTH = 13  # time, then the rows of the 3 x 4 pose matrix; NaN where the sample is invalid


class SampleVectors(LeafSystem):
    """Spreads samples over vectors.

    Ports:
        in  ``joint_sample``  JointSample
        in  ``pose_sample``   PoseSample
        out ``joints``        vector 19: time (s), position (rad), velocity (rad/s), effort (N m)
        out ``pose``          vector 13: time of exposure (s), rows of X_WE; NaN where the sample is invalid
    """

    def __init__(self) -> None:
        super().__init__()
        self._joint_sample = self.DeclareAbstractInputPort("joint_sample", Value(JointSample()))
        self._pose_sample = self.DeclareAbstractInputPort("pose_sample", Value(PoseSample()))
        self.DeclareVectorOutputPort("joints", JOINT_WIDTH, self._calc_joints, {self._joint_sample.ticket()})
        self.DeclareVectorOutputPort("pose", POSE_WIDTH, self._calc_pose, {self._pose_sample.ticket()})

    def _calc_joints(self, context: Context, output: BasicVector) -> None:
        sample: JointSample = self._joint_sample.Eval(context)
        output.set_value(np.concatenate([[sample.time], sample.position, sample.velocity, sample.effort]))

    def _calc_pose(self, context: Context, output: BasicVector) -> None:
        sample: PoseSample = self._pose_sample.Eval(context)
        vector = np.full(POSE_WIDTH, np.nan)
        if sample.valid:
            vector[0], vector[1:] = sample.time, sample.X_WE.GetAsMatrix34().ravel()
        output.set_value(vector)

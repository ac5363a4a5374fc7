# SPDX-License-Identifier: Apache-2.0
"""Composition of several Pinocchio models in one world."""

import numpy as np
import pinocchio as pin


def append_model(model: pin.Model, part: pin.Model, pose: pin.SE3) -> pin.Model:
    """Return a model with another one placed in its world; the joints of `model` come first.

    Args:
        model: Existing model.
        part: Added model, with names of joints and frames that `model` does not use.
        pose: Pose of the base of `part` in the world.
    """
    joined = pin.appendModel(model, part, 0, pose)
    joined.armature = np.concatenate([model.armature, part.armature])  # appendModel drops it.
    return joined

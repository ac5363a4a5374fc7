# SPDX-License-Identifier: Apache-2.0
"""Several Pinocchio models in one world."""

import numpy as np
import pinocchio as pin


def append_model(model: pin.Model, part: pin.Model, pose: pin.SE3) -> pin.Model:
    """A model with another one placed in its world; the joints of `model` come first.

    Args:
        model: What is there already.
        part: What is added; its joints and frames have names that `model` has not.
        pose: Where the base of `part` is in the world.
    """
    joined = pin.appendModel(model, part, 0, pose)
    joined.armature = np.concatenate([model.armature, part.armature])  # Pinocchio forgets it.
    return joined

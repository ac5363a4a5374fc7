# SPDX-License-Identifier: Apache-2.0
"""The block `walls` of a scenario."""

from dataclasses import dataclass

from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import key

REACH = 0.05  # [m] distance from a margin below which pairs of bodies at rest get a row


@dataclass(frozen=True)
class WallSettings:
    """Distances and rates of walls; the block switches them on."""

    margin: float = key("Distance that bodies keep from each other [m]", 0.02, positive=True)
    joint_margin: float = key(
        "Distance that joints keep from their position limits [m or rad]", 0.1, positive=True
    )
    rate: float = key("Rate at which an approach may end at a margin [1/s]", 20.0, positive=True)
    speed_share: float = key(
        "Share of a joint's speed limit that it may reach", 0.9, positive=True, maximum=1.0
    )
    barrier: float = key(
        "Distance at which a barrier begins to push, as a share of the margin", 0.75, positive=True
    )
    barrier_stiffness: float = key(
        "Largest stiffness of the barrier; less where the masses behind it are light [N/m]",
        40000.0,
        minimum=0.0,
    )

    def __post_init__(self) -> None:
        """Refuse a barrier that begins outside the margin.

        Raises:
            ScenarioError: It does.
        """
        if self.barrier >= 1.0:
            raise ScenarioError("walls.barrier", self.barrier, "< 1")

# SPDX-License-Identifier: Apache-2.0
"""What a scenario can say about the connection between the operator's device and the team."""

from dataclasses import dataclass

from noninteract_ros.schema import key


@dataclass(frozen=True)
class LinkSettings:
    """The block `link` of a scenario: a two-way connection that delays and loses, made passive."""

    delay: float = key("Mean delay one way [s]", 0.0, minimum=0.0, maximum=10.0)
    jitter: float = key(
        "Spread of each packet's delay about the mean, as a share of it",
        0.0,
        minimum=0.0,
        maximum=1.0,
    )
    loss: float = key("Share of packets that never arrive", 0.0, minimum=0.0, maximum=1.0)
    reordering: bool = key("Whether a packet may overtake another", True)
    seed: int = key("Seed of delays and losses", 0, minimum=0)
    passivity: str = key(
        "What keeps the connection passive: nothing, time-domain passivity at both ends, or wave"
        " variables under the same account",
        "tdpa",
        choices=("none", "tdpa", "waves"),
    )
    impedance: float = key("waves: impedance of the connection [N s/m]", 20.0, positive=True)
    force_scale: float = key(
        "Share of the team's force that the hand is to feel; the link's energies are those of"
        " this share",
        1.0,
        positive=True,
    )
    bandwidth: float = key(
        "Bandwidth with which the team's end smooths what arrives [rad/s]", 60.0, positive=True
    )
    reserve: float = key("Energy that the team's end may spend beforehand [J]", 0.1, minimum=0.0)
    capacity: float = key("Most energy that an end saves for later [J]", 1.0, positive=True)
    kept: float = key(
        "What the device's end keeps of the energy that it takes up, for its own swings [J]",
        0.02,
        minimum=0.0,
    )
    filling: float = key(
        "tdpa: damping of the device while the team's end has less than the reserve [N s/m]",
        10.0,
        minimum=0.0,
    )

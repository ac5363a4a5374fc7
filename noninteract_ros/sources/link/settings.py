# SPDX-License-Identifier: Apache-2.0
"""Settings of the link between the operator's device and the team."""

from dataclasses import dataclass

from noninteract_ros.schema import key


@dataclass(frozen=True)
class LinkSettings:
    """Block `link` of a scenario: a two-way channel with delay and loss, made passive."""

    delay: float = key("Mean delay one way [s]", 0.0, minimum=0.0, maximum=10.0)
    jitter: float = key(
        "Spread of each packet's delay about the mean, as a share of it",
        0.0,
        minimum=0.0,
        maximum=1.0,
    )
    loss: float = key("Share of packets that never arrive", 0.0, minimum=0.0, maximum=1.0)
    reordering: bool = key("True if packets may overtake each other", True)
    seed: int = key("Seed of delays and losses", 0, minimum=0)
    passivity: str = key(
        "Passivity of the connection: none, time-domain passivity control at both ends, or wave"
        " variables with the same energy account",
        "tdpa",
        choices=("none", "tdpa", "waves"),
    )
    impedance: float = key("waves: impedance of the connection [N s/m]", 20.0, positive=True)
    force_scale: float = key(
        "Share of the team's force that is reflected to the hand; the link's energies are those of"
        " this share",
        1.0,
        positive=True,
    )
    bandwidth: float = key(
        "Bandwidth of the team's end, which smooths the received motion [rad/s]",
        60.0,
        positive=True,
    )
    reserve: float = key("Initial energy of the team's end [J]", 0.1, minimum=0.0)
    capacity: float = key("Largest energy that an end stores [J]", 1.0, positive=True)
    kept: float = key(
        "Absorbed energy that the device's end keeps for its own oscillations [J]",
        0.02,
        minimum=0.0,
    )
    filling: float = key(
        "tdpa: damping of the device while the energy of the team's end is below the reserve"
        " [N s/m]",
        10.0,
        minimum=0.0,
    )

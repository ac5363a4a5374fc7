# SPDX-License-Identifier: Apache-2.0
"""Settings of the operator's console."""

import ipaddress
from dataclasses import dataclass

from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import key


@dataclass(frozen=True)
class ConsoleSettings:
    """Block `console` of a scenario; all keys have defaults.

    Raises:
        ScenarioError: The host is no IP address.
    """

    host: str = key(
        "Address to listen on; any address other than this machine's own requires a token",
        "127.0.0.1",
    )
    port: int = key("Port to listen on; 0: any free port", 8090, minimum=0, maximum=65535)
    origins: tuple[str, ...] = key(
        "Further origins that may connect, such as a proxy: https://name:port", ()
    )
    frame_rate: float = key(
        "Rate of frames sent to a page [Hz]", 60.0, positive=True, maximum=120.0
    )
    update_rate: float = key(
        "Rate of references while a page drives [Hz]", 120.0, minimum=20.0, maximum=1000.0
    )
    hold_timeout: float = key(
        "Timeout of the driving page after which the subtask holds [s]",
        0.15,
        positive=True,
        maximum=0.4,
    )
    max_message: int = key("Largest message of a page [bytes]", 4096, minimum=256)
    max_message_rate: float = key(
        "Largest sustained message rate of a page [Hz]", 150.0, minimum=50.0
    )
    max_pages: int = key("Largest number of open pages", 16, minimum=1)

    def __post_init__(self) -> None:
        if self.host != "localhost":
            try:
                ipaddress.ip_address(self.host)
            except ValueError:
                allowed = "an IP address or localhost"
                raise ScenarioError("console.host", repr(self.host), allowed) from None

    @property
    def is_local(self) -> bool:
        """True if only this machine can connect."""
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return self.host == "localhost"

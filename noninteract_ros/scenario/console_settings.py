# SPDX-License-Identifier: Apache-2.0
"""What a scenario can say about the operator's console."""

import ipaddress
from dataclasses import dataclass

from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import key


@dataclass(frozen=True)
class ConsoleSettings:
    """The block `console` of a scenario; all of it has defaults."""

    host: str = key(
        "Address to listen on; any but this machine's own demands a token", "127.0.0.1"
    )
    port: int = key("Port to listen on; 0: a free one", 8090, minimum=0, maximum=65535)
    origins: tuple[str, ...] = key(
        "Further origins that may connect, such as that of a proxy: https://name:port", ()
    )
    frame_rate: float = key("Rate of pictures [Hz]", 60.0, positive=True, maximum=120.0)
    update_rate: float = key(
        "Rate of references while somebody drives [Hz]", 120.0, minimum=20.0, maximum=1000.0
    )
    hold_timeout: float = key(
        "Silence of the driving page that lets go for it [s]", 0.15, positive=True, maximum=0.4
    )
    max_message: int = key("Largest message of a page [bytes]", 4096, minimum=256)
    max_message_rate: float = key(
        "Messages per second that a page may send in the long run [Hz]", 150.0, minimum=50.0
    )
    max_pages: int = key("Pages that may be open at a time", 16, minimum=1)

    @property
    def is_local(self) -> bool:
        """Whether nobody but this machine can connect."""
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return self.host == "localhost"

    def check(self) -> None:
        """Raises ScenarioError where the address is none."""
        if self.host != "localhost":
            try:
                ipaddress.ip_address(self.host)
            except ValueError:
                allowed = "an IP address or localhost"
                raise ScenarioError("console.host", repr(self.host), allowed) from None

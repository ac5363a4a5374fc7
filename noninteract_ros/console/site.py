# SPDX-License-Identifier: Apache-2.0
"""Static files, access policy and rate limit of the console server."""

from pathlib import Path
from urllib.parse import urlsplit

from noninteract_ros.scenario.console_settings import ConsoleSettings

STATIC = Path(__file__).parent / "static"
CONTENT_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".txt": "text/plain; charset=utf-8",
}
LOCAL_NAMES = ("localhost", "127.0.0.1", "::1")
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self';"
        " img-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-cache",
}


def load_static_files(folder: Path = STATIC) -> dict[str, tuple[str, bytes]]:
    """Return content type and content of each file, by path; `/` is the page."""
    files = {
        f"/{file.name}": (CONTENT_TYPES[file.suffix], file.read_bytes())
        for file in folder.iterdir()
        if file.suffix in CONTENT_TYPES
    }
    files["/"] = files["/index.html"]
    return files


class AccessPolicy:
    """Hosts and origins whose requests are answered.

    A page of another origin may be open in the same browser. It must not reach the console,
    neither by its own name nor by a name that was made to resolve to this address.

    Args:
        settings: Address of the console and further origins that may connect.
    """

    def __init__(self, settings: ConsoleSettings) -> None:
        self._origins = settings.origins
        self._local = settings.is_local
        own = {urlsplit(origin).hostname or "" for origin in settings.origins}
        self._hosts = {*LOCAL_NAMES, settings.host, *own}

    def allows_host(self, host: str | None) -> bool:
        """Return True if a request's Host names this console.

        On other addresses than this machine's own, every Host is allowed: the token decides.
        """
        if not self._local:
            return True
        return host is not None and urlsplit(f"//{host}").hostname in self._hosts

    def allows_origin(self, origin: str | None, host: str | None) -> bool:
        """Return True if a WebSocket's Origin is the console's own page or a configured one."""
        if not origin or not host:
            return False
        return origin in self._origins or origin in (f"http://{host}", f"https://{host}")


class RateLimit:
    """Token bucket with a capacity of one second.

    Args:
        rate: Messages per second in the long run [Hz].
    """

    def __init__(self, rate: float) -> None:
        self._rate = self._tokens = rate
        self._updated_at: float | None = None

    def accept(self, now: float) -> bool:
        """Return True if one more message is allowed at this time of the monotonic clock [s]."""
        if self._updated_at is not None:
            tokens = self._tokens + (now - self._updated_at) * self._rate
            self._tokens = min(self._rate, tokens)
        self._updated_at = now
        if self._tokens < 1.0:
            return False
        self._tokens -= 1.0
        return True

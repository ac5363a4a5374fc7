# SPDX-License-Identifier: Apache-2.0
"""The page's own files, and who may ask for them."""

from pathlib import Path
from urllib.parse import urlsplit

from noninteract_ros.scenario.console_settings import ConsoleSettings

STATIC = Path(__file__).parent / "static"
KINDS = {
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


def load_site(folder: Path = STATIC) -> dict[str, tuple[str, bytes]]:
    """Kind and content of each file, by path; `/` is the page."""
    files = {
        f"/{file.name}": (KINDS[file.suffix], file.read_bytes())
        for file in folder.iterdir()
        if file.suffix in KINDS
    }
    files["/"] = files["/index.html"]
    return files


class AccessPolicy:
    """Says whose requests are answered.

    A page of another origin may be open in the same browser: it must not reach the console, be it
    by its own name or by a name that was made to point here.

    Args:
        settings: Where the console listens, and which other origins may connect.
    """

    def __init__(self, settings: ConsoleSettings) -> None:
        self._origins = settings.origins
        self._local = settings.is_local
        own = {urlsplit(origin).hostname or "" for origin in settings.origins}
        self._hosts = {*LOCAL_NAMES, settings.host, *own}

    def knows_host(self, host: str | None) -> bool:
        """Whether a request's Host is a name of this console; elsewhere the token decides."""
        if not self._local:
            return True
        return host is not None and urlsplit(f"//{host}").hostname in self._hosts

    def knows_origin(self, origin: str | None, host: str | None) -> bool:
        """Whether a WebSocket's Origin is this console's own page, or one that is allowed."""
        if not origin or not host:
            return False
        return origin in self._origins or origin in (f"http://{host}", f"https://{host}")

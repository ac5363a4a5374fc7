# SPDX-License-Identifier: Apache-2.0
"""The documentation site: it builds strictly, and asks no other host for anything."""

import functools
import json
import os
import re
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from html.parser import HTMLParser
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
import scenario_reference
from repository import ROOT

# What a page fetches by itself; links that a reader follows are no such thing.
FETCHED = {
    "audio": "src",
    "embed": "src",
    "iframe": "src",
    "img": "src",
    "link": "href",
    "script": "src",
    "source": "src",
    "video": "src",
}
CHROMIUM = shutil.which("chromium")
DEADLINE = 120e3  # [ms] for a browser on a busy machine
NOT_FETCHED = ("canonical", "next", "prev")  # relations of <link>


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a site that was built strictly."""
    folder = tmp_path_factory.mktemp("site")
    ended = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", folder],
        cwd=ROOT,
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
    )
    assert ended.returncode == 0, ended.stderr
    return folder


class Resources(HTMLParser):
    """Addresses of what a page fetches, and the names that it defines."""

    def __init__(self) -> None:
        super().__init__()
        self.fetched: list[str] = []
        self.names: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Take the attributes of an element."""
        given = dict(attrs)
        self.names |= {given.get("id") or "", *(given.get("class") or "").split()}
        address = given.get(FETCHED.get(tag, ""))
        if address and given.get("rel") not in NOT_FETCHED:
            self.fetched.append(address)


def resources(file: Path) -> Resources:
    """Return the resources of a page."""
    found = Resources()
    found.feed(file.read_text())
    return found


def test_pages_fetch_only_files_of_the_site(site: Path) -> None:
    """Scripts, styles, fonts and pictures of every page are files of the site."""
    pages = list(site.rglob("*.html"))
    assert len(pages) > 20
    for page in pages:
        if page.name == "404.html":  # Its addresses start at the root of a server.
            continue
        found = resources(page)
        for address in found.fetched:
            assert not re.match(r"(https?:)?//", address), f"{page}: {address}"
            if not address.startswith("data:"):
                assert (page.parent / re.split("[?#]", address)[0]).is_file(), f"{page}: {address}"
        # The theme would fetch the library that draws them.
        assert "mermaid" not in found.names, page


def test_styles_fetch_only_files_of_the_site(site: Path) -> None:
    """Fonts and pictures of every style sheet are files of the site."""
    for style in site.rglob("*.css"):
        for address in re.findall(r"url\(['\"]?([^'\")]+)", style.read_text()):
            if not address.startswith(("data:", "#")):
                assert (style.parent / re.split("[?#]", address)[0]).is_file(), address


def test_every_key_has_an_address(site: Path) -> None:
    """Links can lead to every key of the scenario."""
    names = resources(site / "reference/scenario.html").names
    for block, settings in scenario_reference.BLOCKS.items():
        for item in scenario_reference.own_keys(settings):
            assert f"{block}.{item.name}" in names


def test_search_knows_keys_and_topics(site: Path) -> None:
    """The index of the search holds a key, a topic and an API name."""
    index = json.loads((site / "search/search_index.json").read_text())
    texts = " ".join(entry["text"] for entry in index["docs"])
    for word in ("refill_fraction", "external_wrench", "TeamController"):
        assert word in texts


@pytest.fixture(scope="module")
def address(site: Path) -> Iterator[str]:
    """Serve the site on this machine."""
    handler = functools.partial(QuietHandler, directory=str(site))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()
        thread.join()


class QuietHandler(SimpleHTTPRequestHandler):
    """A server of files that logs nothing."""

    def log_message(self, format: str, *args: object) -> None:
        """Log nothing."""


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium here: apt-get install chromium")
@pytest.mark.parametrize("scheme", ["http", "file"])
def test_formulas_and_search_work_without_the_network(
    site: Path, address: str, scheme: str
) -> None:
    """A browser sets all formulas and finds a page, with requests to this site alone."""
    from playwright.sync_api import sync_playwright

    root = address if scheme == "http" else site.as_uri()
    asked: list[str] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page()
        page.set_default_timeout(DEADLINE)
        page.on("request", lambda request: asked.append(request.url))
        page.goto(f"{root}/derivations.html")
        page.wait_for_selector(".katex")
        assert page.locator(".arithmatex:not(:has(.katex))").count() == 0
        assert page.locator(".katex-error").count() == 0
        page.locator(".md-search__input").fill("refill_fraction")
        page.wait_for_selector(".md-search-result__item a[href*='scenario.html']")
        browser.close()
    strangers = [url for url in asked if not url.startswith((root, "data:", "blob:"))]
    assert not strangers

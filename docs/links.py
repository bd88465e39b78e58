"""Check that links within the site have an end, and lead sources to their pages.

Sphinx checks the links that pages write; links that extensions write into the pages are
checked here, when the pages are there.
"""

import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from sphinx.application import Sphinx
from sphinx.util import logging

TO_PAGE = re.compile(r'(class="viewcode-back" href="[./]*([^"#]*)\.html)#([^"]+)"')
"""A link from a source to a page: up to the address, name of the page, anchor."""


class _Page(HTMLParser):
    """Gather the anchors of a page, and where its links lead."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.feed(file.read_text())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Take a tag."""
        for name, value in attrs:
            if value and name == "id":
                self.anchors.add(value)
            if value and name in ("href", "src"):
                self.links.append(value)


def lead_to_pages(app: Sphinx, page: str, template: str, context: Any, doctree: Any) -> None:
    """Give the links of a source the anchors that their pages have.

    viewcode knows one prefix for each module, whose objects may have pages under
    several.
    """
    if not page.startswith("_modules/"):
        return
    objects = app.env.domains.python_domain.objects

    def led(link: re.Match[str]) -> str:
        start, target, name = link.groups()
        last = name.rpartition(".")[2]
        alike = [known for known in objects if known.rpartition(".")[2] == last]
        for known in (name, *alike):
            if known in objects and objects[known].docname == target:
                return f'{start}#{objects[known].node_id}"'
        return link[0]

    context["body"] = TO_PAGE.sub(led, context["body"])


def tell_dead_links(app: Sphinx, failure: Exception | None) -> None:
    """Warn of links to files and anchors that the site does not have."""
    if failure is not None or app.builder.format != "html":
        return
    pages = {file: _Page(file) for file in Path(app.outdir).resolve().rglob("*.html")}
    for file, page in pages.items():
        for link in page.links:
            address = urlsplit(link)
            if address.scheme or address.netloc:
                continue
            end = (file.parent / unquote(address.path)).resolve() if address.path else file
            anchor = unquote(address.fragment)
            has_anchor = not anchor or end not in pages or anchor in pages[end].anchors
            if not (end.is_file() and has_anchor):
                logging.getLogger(__name__).warning("dead link in %s: %s", file.name, link)


def setup(app: Sphinx) -> None:
    """Mend and check links."""
    app.connect("html-page-context", lead_to_pages)
    app.connect("build-finished", tell_dead_links)

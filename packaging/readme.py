"""Make the README of PyPI, whose links and pictures need addresses.

The address of the project stands in ``project.urls`` of pyproject.toml, under Source,
and nowhere else. Without it links are words, and pictures are left out.
"""

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

PICTURE = re.compile(r"!\[([^\]]*)\]\((?!\w+:)([^)]+)\)\n*")
"""A picture of the repository."""
LINK = re.compile(r"\[([^\]]+)\]\((?!\w+:)([^)]+)\)")
"""A link to a file of the repository; it may go over a line."""


def with_addresses(text: str, source: str | None) -> str:
    """Return a text whose links and pictures need no clone.

    Args:
        text: The README.
        source: Address of the repository, or None.
    """
    if source is None:
        return LINK.sub(r"\1", PICTURE.sub("", text))
    text = PICTURE.sub(rf"![\1]({source}/raw/main/\2)\n\n", text)
    return LINK.sub(rf"[\1]({source}/blob/main/\2)", text)


class Readme(MetadataHookInterface):
    """Give the package its README."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Add the README to the metadata of the package."""
        text = Path(self.root, "README.md").read_text()
        source = metadata.get("urls", {}).get("Source")
        metadata["readme"] = {
            "content-type": "text/markdown",
            "text": with_addresses(text, source),
        }

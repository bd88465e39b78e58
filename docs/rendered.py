"""Check rendered pages: formulas are formulas, and no ``$`` is left in the text."""

import re
from typing import Any

from sphinx.application import Sphinx
from sphinx.util import logging

LITERAL = re.compile(
    r"<pre.*?</pre>|<code.*?</code>|<script.*?</script>|"
    r'<(span|div) class="math[^"]*".*?</\1>|<[^>]*>',
    re.DOTALL,
)
"""Parts of a page in which a ``$`` is right: code, formulas for MathJax, tags."""


def tell_raw_formulas(
    app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: Any
) -> None:
    """Warn of a ``$`` in the text of a page, as a formula cut by a list leaves it."""
    text = LITERAL.sub("", context.get("body", ""))
    for line in text.splitlines():
        if "$" in line:
            logging.getLogger(__name__).warning("raw $ in %s: %s", page, line.strip())


def setup(app: Sphinx) -> None:
    """Look at each page when it is rendered."""
    app.connect("html-page-context", tell_raw_formulas)

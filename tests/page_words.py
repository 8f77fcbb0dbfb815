"""What a page says, as a reader sees it: without tags, links and non-breaking spaces."""

import html
import re


def said(page: str) -> str:
    """Returns the text of a page, what is quoted as code without its quotes."""
    return html.unescape(re.sub(r"<[^>]+>", "", page)).replace("\N{NO-BREAK SPACE}", " ")

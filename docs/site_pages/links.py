"""Links from typed pages to generated ones: in the repository they lead to what the page is generated from.

docs/*.md with links to sources --to_pages, while Sphinx reads them--> links to the generated pages
"""

from __future__ import annotations

import posixpath
import re
from typing import Final

from site_pages.tutorials import ORDER

PAGE_OF: Final = {
    **{f"gallery/{name}": f"tutorials/{name.removesuffix('.py')}" for name in ORDER},
    "../shared/twingap/effects": "reference/catalogue.md",
    "../shared/twingap/gap/report/gap_report.schema.json": "reference/gap-json.md",
    "../shared/twingap/records/samples.py": "reference/sample-files.md",
    "../reports/gap/README.md": "explanation/validation.md",
    "../CONTRIBUTING.md": "contributing.md",
}
"""Source of a page -> the page, both relative to docs/."""
LINK: Final = re.compile(r"(?<=\]\()[^)\s#]+(?=[)#])")
"""Target of a link in Markdown."""


def to_pages(text: str, docname: str) -> str:
    """Text of a page with links to the generated pages in place of links to their sources."""
    folder = posixpath.dirname(docname)

    def page(found: re.Match[str]) -> str:
        of = PAGE_OF.get(posixpath.normpath(posixpath.join(folder, found[0])))
        return found[0] if of is None else posixpath.relpath(of, folder or ".")

    return LINK.sub(page, text)

"""README and the pages of the site that are written by hand, for tests of what they say."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
README = ROOT / "README.md"
PAGES = (README, *sorted(p for folder in ("guides", "explanation") for p in (ROOT / "docs" / folder).glob("*.md")))
TEXTS = {page.stem: page.read_text(encoding="utf-8") for page in PAGES}
TEXT = "\n".join(TEXTS.values())
"""All of them, one after the other."""


def blocks(text: str, kind: str = "") -> list[str]:
    """Return the code blocks of a language, or of none."""
    found = re.findall(r"^```(\w*)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    return [code for named, code in found if named == kind]

"""README and the site's pages keep to the rules of docs/vale, which are read as Vale reads them."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from support.documentation import PAGES, ROOT

RULES: dict[str, dict[str, Any]] = {
    file.stem: yaml.safe_load(file.read_text(encoding="utf-8")) for file in (ROOT / "docs" / "vale").rglob("*.yml")
}
TUTORIALS = sorted((ROOT / "docs" / "tutorials").glob("*.md"))


def prose(text: str) -> str:
    """Return a page without its head, code, tables and addresses."""
    text = re.sub(r"\A---\n.*?^---\n", "", text, flags=re.DOTALL | re.MULTILINE)
    text = re.sub(r"^(```|:::)[^\n]*\n.*?^\1$", "\n", text, flags=re.DOTALL | re.MULTILINE)
    text = re.sub(r"^\|.*$", "", text, flags=re.MULTILINE)
    return re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", re.sub(r"`[^`]*`", "CODE", text))


def alerts(text: str) -> Iterator[str]:
    """Yield each place that a rule does not allow."""
    plain = prose(text)
    for rule in RULES.values():
        if rule["extends"] == "occurrence":
            for paragraph in re.split(r"\n\s*\n|^(?:[-*]|\d+\.) ", plain, flags=re.MULTILINE):
                for sentence in re.split(r"(?<=[.!?])\s+(?=[A-Z*])", " ".join(paragraph.split())):
                    if len(re.findall(rule["token"], sentence)) > rule["max"]:
                        yield f"{rule['message']}: {sentence}"
        else:
            words = rule["tokens"] if rule["extends"] == "existence" else list(rule["swap"])
            for found in re.finditer(rf"\b(?:{'|'.join(words)})\b", plain, re.IGNORECASE):
                yield f"{rule['message']}: {found[0]}"


@pytest.mark.parametrize("page", [*PAGES, *TUTORIALS], ids=lambda page: str(page.relative_to(ROOT)))
def test_a_page_keeps_to_the_rules_of_language(page: Path):
    assert list(alerts(page.read_text(encoding="utf-8"))) == []


def test_a_rule_finds_what_it_is_about_and_leaves_code_alone():
    assert set(RULES) == {"Dialect", "SentenceLength", "Spelling"}
    assert list(alerts("`told` and [a link](whoever)\n\n```\nthe color\n```\n\n| amiss |\n")) == []
    assert len(list(alerts("He was told of a color. " + "word " * 29))) == 3

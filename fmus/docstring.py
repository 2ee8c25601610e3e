"""A docstring's parts as the documentation page has them: paragraphs, lists, formulas, and the errors that it names."""

import re
from dataclasses import dataclass

_RAISES = "Raises:"
_NAMES = re.compile(r"(\w+(?:, \w+)*): (.*)", re.DOTALL)


@dataclass(frozen=True)
class Part:
    """A part of a docstring.

    Attributes:
        kind: `paragraph`, `list` or `formula`.
        texts: one text, or one for each item of a list; a formula's keeps its lines.
    """

    kind: str
    texts: tuple[str, ...]


@dataclass(frozen=True)
class Docstring:
    """What a docstring says, and the errors it names: their names with when they are raised."""

    parts: tuple[Part, ...]
    errors: tuple[tuple[str, str], ...]


def parse(text: str) -> Docstring:
    """Return a docstring's parts; `text` is without the indentation that it has in its source."""
    parts: list[Part] = []
    errors: list[tuple[str, str]] = []
    for chunk in re.split(r"\n[ \t]*\n", text.strip("\n")):
        lines = chunk.splitlines()
        if lines and lines[0].strip() == _RAISES:
            errors += [_error(item) for item in _items(lines[1:], r"    \S")]
        elif chunk.startswith("    "):
            parts.append(Part("formula", ("\n".join(line.removeprefix("    ") for line in lines),)))
        elif chunk.strip():
            parts += _prose(lines)
    return Docstring(tuple(parts), tuple(errors))


def _prose(lines: list[str]) -> list[Part]:
    """Return a paragraph, a list, or a list that follows upon a line of text."""
    first = next((i for i, line in enumerate(lines) if line.startswith("- ")), len(lines))
    paragraph = [Part("paragraph", (_joined(lines[:first]),))] if first else []
    items = tuple(item.removeprefix("- ") for item in _items(lines[first:], "- "))
    return [*paragraph, Part("list", items)] if items else paragraph


def _items(lines: list[str], begin: str) -> list[str]:
    """Return the items of lines, of which each first one matches `begin`, as one line each."""
    found: list[list[str]] = []
    for line in lines:
        if re.match(begin, line) or not found:
            found.append([])
        found[-1].append(line)
    return [_joined(item) for item in found]


def _joined(lines: list[str]) -> str:
    return " ".join(line.strip() for line in lines)


def _error(text: str) -> tuple[str, str]:
    match = _NAMES.fullmatch(text)
    return (match[1], match[2]) if match else ("", text)

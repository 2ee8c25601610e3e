"""Keeps numbers and their units together where a line breaks."""

import re

_PARTS = re.compile(r"(<script\b.*?</script>|<style\b.*?</style>|<[^>]+>)", re.DOTALL)
_UNIT = re.compile(r"(?<=\d) (?=(?:%|°|[kmµ]?m|[mµ]?s|m?N|k?g|m?rad|h|A|bar|k?Pa|[MG]B|N·m|N m|m/s|rad/s)(?![\w/]))")
_RANGE = re.compile(r"(?<=\d) to (?=-?\d)")
_EQUAL = re.compile(r"\b(\w) ([=<]) (?=-?\d)")
_SPACE = "\u00a0"


def tied(html: str) -> str:
    """Return HTML in whose text no line breaks within "5 mm", "3 to 5 %" and "p = 0.03"; scripts stay as they are."""
    parts = _PARTS.split(html)
    parts[::2] = [_tied(text) for text in parts[::2]]
    return "".join(parts)


def _tied(text: str) -> str:
    text = _RANGE.sub(f"{_SPACE}to{_SPACE}", _UNIT.sub(_SPACE, text))
    return _EQUAL.sub(rf"\1{_SPACE}\2{_SPACE}", text)

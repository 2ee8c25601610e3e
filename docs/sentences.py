"""Sentences of built pages that are too long to be understood at the first reading, wherever their text comes from.

Pages that are written by hand have a lower limit (`vale/House/SentenceLength.yml`); this one is for what the reference
takes from declarations, docstrings and results of runs, too.
"""

import html
import re

MOST_WORDS = 32

_TEXT = re.compile(r"<(p|figcaption|li|td|dd)\b[^>]*>((?:(?!<(?:p|figcaption|li|td|dd)\b).)*?)</\1>", re.DOTALL)
"""What holds text, and nothing else that does."""
_NO_WORDS = re.compile(r"<(code|math|svg)\b.*?</\1>", re.DOTALL)
_TAG = re.compile(r"<[^>]+>")
_NUMBERED = re.compile(r"\b\d+ [a-z ]+(?:, \d+ [a-z ]+)+")
"""A list such as "0 none, 1 out of reach"."""
_END = re.compile(r"(?<=[.!?])\s+(?=[A-Z\[(]|[\w-]+: )")
_WORD = re.compile(r"[\w'%./,-]*\w[\w'%/-]*")


def long_sentences(page: str) -> list[str]:
    """Return a built page's sentences of more words than `MOST_WORDS`, without code, equations and numbered lists."""
    article = page[max(0, page.find("<article")) :]
    texts = (_TAG.sub("", _NO_WORDS.sub(" CODE ", found)) for _, found in _TEXT.findall(article))
    sentences = (s for text in texts for s in _END.split(_NUMBERED.sub("", " ".join(html.unescape(text).split()))))
    return [s for s in sentences if sum(word != "CODE" for word in _WORD.findall(s)) > MOST_WORDS]

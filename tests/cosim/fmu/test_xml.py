import contextlib
import tracemalloc

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.wording import Wording

from handover.cosim.fmu.file.xml import UnsafeXml, parse_xml, with_prefixes

LAUGHS = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 11))
BILLION_LAUGHS = f'<?xml version="1.0"?><!DOCTYPE l [<!ENTITY l0 "ha">{LAUGHS}]><l>&l10;</l>'.encode()


def test_elements_know_their_lines_attributes_and_children():
    root = parse_xml(b'<?xml version="1.0"?>\n<a><!-- b -->\n<b c="1"/><?d e?>\n<b c="2"><f/></b></a>')
    assert [(b.line, b.get("c")) for b in root.named("b")] == [(3, "1"), (4, "2")]
    assert [f.tag for f in root.named("b", "f")] == ["f"]
    assert root.get("missing", "nothing") == "nothing"


def test_a_billion_laughs_are_refused_without_being_laughed():
    tracemalloc.start()
    try:
        with pytest.raises(UnsafeXml, match="document type"):
            parse_xml(BILLION_LAUGHS)
        assert tracemalloc.get_traced_memory()[1] < 1 << 20
    finally:
        tracemalloc.stop()


def test_what_is_not_to_be_read_is_refused(wording: Wording):
    for content in (
        b'<!DOCTYPE a SYSTEM "http://127.0.0.1:9/a.dtd"><a/>',
        b'<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/passwd">]><a>&b;</a>',
        "<!DOCTYPE a [<!ENTITY b 'c'>]><a>&b;</a>".encode("utf-16"),
        b"<a>&b;</a>",
        b"<a><b></a>",
        b"",
        b'<a b="\xff"/>',
        b'<?xml version="1.0" encoding="klingon"?><a/>',
        b"<a>" * 300 + b"</a>" * 300,
    ):
        with pytest.raises(UnsafeXml) as caught:
            parse_xml(content)
        wording.check(caught.value)


def test_prefixes_that_are_not_declared_are_made_up():
    text = b"<?xml version='1.0'?>\n<a xmlns:k='urn:k'><k:b/><v:c w:d='1' xmlns:v='urn:v'/>\n<v:e/></a>"
    root = parse_xml(text)
    b, c, e = root.children
    assert (root.tag, b.tag, c.tag, e.line) == ("a", "{urn:k}b", "{urn:v}c", 3)
    assert len(c.attributes) == 1
    declared = text.replace(b"w:", b"").replace(b"<v:e/>", b"")
    assert with_prefixes(declared) == declared
    assert parse_xml(text.decode().encode("utf-16")).children[2].line == 3
    with pytest.raises(UnsafeXml, match="mismatched tag"):
        parse_xml(b"<a><v:b></a>")


@given(st.binary(max_size=200) | st.text(alphabet="<>/=\"'a &;![]-?\n", max_size=80).map(str.encode))
def test_whatever_the_bytes_they_are_parsed_or_refused(content: bytes):
    with contextlib.suppress(UnsafeXml):
        parse_xml(content)


@given(st.sampled_from(["utf-8", "utf-16", "iso-8859-1", "us-ascii", "utf-7", "utf-32", "big5", "rot13", "idna", ""]))
def test_whatever_the_encoding_it_is_read_or_refused(encoding: str):
    try:
        assert parse_xml(f'<?xml version="1.0" encoding="{encoding}"?><a/>'.encode()).tag == "a"
    except UnsafeXml:
        assert encoding not in ("utf-8", "us-ascii", "iso-8859-1")


@pytest.mark.parametrize("declared", ["", "".join(f' xmlns:p{k}="u"' for k in range(1001))])
def test_prefixes_that_would_take_minutes_are_refused(declared: str):
    text = f"<a{declared}>{''.join(f'<p{k}:b/>' for k in range(1001))}</a>"
    with pytest.raises(UnsafeXml, match="over 1000 prefixes"):
        parse_xml(text.encode())
    beside = "".join('<k:b xmlns:k="u"/>' for _ in range(1001))
    assert len(parse_xml(f"<a>{beside}</a>".encode()).children) == 1001


def test_a_tree_beyond_all_memory_is_refused(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("handover.cosim.fmu.file.xml._MOST_MARKS", 100)
    for text in (b"<a>" + b"<b/>" * 101 + b"</a>", b"<a>" + b'<b c="1" d="2" e="3"/>' * 30 + b"</a>"):
        with pytest.raises(UnsafeXml, match="million tags"):
            parse_xml(text)

from handover.scenarios.runs.reporting.page import typeset


def test_a_line_does_not_break_within_a_number_with_its_unit():
    assert typeset("<p>16 to 30 % in 5 mm, p = 0.03; 5 small</p>") == (
        "<p>16\u00a0to\u00a030\u00a0% in 5\u00a0mm, p\u00a0=\u00a00.03; 5 small</p>"
    )


def test_scripts_and_attributes_stay():
    html = '<i title="5 mm"></i><script type="application/json">{"a": "<5 mm"}</script>'
    assert typeset(html) == html


def test_what_stands_between_backticks_is_code_but_for_what_is_code_already():
    assert typeset("<p>`--model` takes it; 5` and 6</p>") == "<p><code>--model</code> takes it; 5` and 6</p>"
    for html in ("<pre>a `b` c</pre>", "<code>a `b`</code>", '<i title="`b`"></i>'):
        assert typeset(html) == html

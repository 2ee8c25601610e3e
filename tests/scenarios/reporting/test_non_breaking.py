from handover.scenarios.reporting.page import non_breaking


def test_a_line_does_not_break_within_a_number_with_its_unit():
    assert non_breaking("<p>16 to 30 % in 5 mm, p = 0.03; 5 small</p>") == (
        "<p>16\u00a0to\u00a030\u00a0% in 5\u00a0mm, p\u00a0=\u00a00.03; 5 small</p>"
    )


def test_scripts_and_attributes_stay():
    html = '<i title="5 mm"></i><script type="application/json">{"a": "<5 mm"}</script>'
    assert non_breaking(html) == html

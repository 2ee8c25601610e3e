"""Which tests are run for a changed file."""

from pathlib import Path

import pytest

from support.changed import select


@pytest.mark.parametrize(
    ("changed", "test"),
    [
        pytest.param(
            "controllers/free_flyer/admittance_controller.py",
            "tests/controllers/free_flyer/test_admittance_controller.py",
            id="module",
        ),
        pytest.param("tests/support/wording.py", "tests/support/test_wording.py", id="helper"),
        pytest.param("tests/support/test_changed.py", "tests/support/test_changed.py", id="test"),
        pytest.param("cosim/plan/plan.c", "tests/cosim/plan", id="C"),
    ],
)
def test_those_that_import_it_or_are_beside_it(changed: str, test: str):
    assert Path(test) in select([Path(changed)])


def test_a_controllers_module_is_not_a_reason_to_run_everything():
    assert len(select([Path("controllers/free_flyer/admittance_controller.py")])) < 10


def test_a_page_needs_none():
    assert not select([Path("README.md")])

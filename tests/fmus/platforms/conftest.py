import shutil
from collections.abc import Generator

import pytest

import handover.fmus.compile


@pytest.fixture(scope="module", autouse=True)
def own_runtime(tmp_path_factory: pytest.TempPathFactory) -> Generator[None, None, None]:
    """Let libraries of other platforms go beside copied sources.

    A unit brings all platforms that are compiled, so that its bytes would differ from those of runs that tests keep.
    """
    copy = shutil.copytree(handover.fmus.compile.RUNTIME, tmp_path_factory.mktemp("sources") / "runtime")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(handover.fmus.compile, "RUNTIME", copy)
        yield

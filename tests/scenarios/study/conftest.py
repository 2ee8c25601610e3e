import pytest
from support.scenarios.sample_study import compliant_fails, rigid_is_better, write_study

from handover.scenarios.study.folder.study_folder import StudyFolder


@pytest.fixture(scope="session")
def twelve(tmp_path_factory: pytest.TempPathFactory) -> StudyFolder:
    """Return a study of twelve people in which rigid is rated better and compliant fails; not to be changed."""
    return write_study(tmp_path_factory.mktemp("study") / "out", 12, rigid_is_better, compliant_fails)

import pytest
from support.scenarios.vsl_training_points import Trained, call


@pytest.fixture(scope="session")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Trained:
    """Return a training by the command, made once."""
    folder = tmp_path_factory.mktemp("trained")
    model, data = folder / "m.json", folder / "d.parquet"
    done = call("--points", "400", "--seed", "1", "--save-data", data, "--out", model)
    assert done.exit_code == 0, done.output
    return Trained(model, data, done.output)

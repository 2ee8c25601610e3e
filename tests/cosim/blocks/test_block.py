from handover.cosim.blocks.block import InvalidParameters


class Hot(InvalidParameters):
    """Too hot."""

    block = "Oven"


def test_a_refusal_names_its_block_and_all_faults():
    refusal = Hot(["t = 900 must be at most 300", "door open"])
    assert str(refusal) == "Oven: t = 900 must be at most 300; door open"
    assert refusal.faults == ["t = 900 must be at most 300", "door open"]
    assert isinstance(refusal, ValueError)

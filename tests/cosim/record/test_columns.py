"""Values of a record's columns are those that pyarrow gives, without what it loads for them."""

import subprocess
import sys
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from handover.cosim.record.columns import column_values

ARRAYS: dict[str, Any] = {
    "reals": pa.array([0.5, float("nan"), -0.0, 3.0]),
    "integers": pa.array([1, -(2**63), 2**63 - 1, 4]),
    "unsigned": pa.array([0, 2**64 - 1, 2, 3], pa.uint64()),
    "truths": pa.array([True, False, False, True] * 5),
    "of another width": pa.array([1.0, 2.0, 3.0, 4.0], pa.float32()),
    "with a gap": pa.array([1.0, None, 3.0, 4.0]),
    "texts": pa.array(["a", "b", "c", "d"]),
}


@pytest.mark.parametrize("name", ARRAYS)
def test_they_are_those_of_to_numpy_whole_sliced_chunked_and_empty(name: str):
    array = ARRAYS[name]
    for given in (array, array[1:3], array[3:], array[:0]):
        for column in (given, pa.chunked_array([given]), pa.chunked_array([given, array[2:2], array[1:]])):
            wanted = column.to_numpy(zero_copy_only=False)
            found = column_values(column)
            assert (found.dtype, found.shape) == (wanted.dtype, wanted.shape)
            np.testing.assert_array_equal(found, wanted)
            assert found.dtype.kind == "O" or found.tobytes() == wanted.tobytes()


def test_pandas_is_not_loaded_for_them():
    program = """
import sys, numpy as np, pyarrow as pa
from handover.cosim.record.columns import _array, column_values
column_values(pa.chunked_array([_array(pa.float64(), np.zeros(3)), _array(pa.float64(), np.ones(2))]))
column_values(_array(pa.bool_(), np.ones(9, dtype=bool)))
print("pandas" in sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"

"""Whether an FMU's model description is valid, as FMPy sees it."""

import re
from pathlib import Path
from typing import Any

import fmpy
from fmpy.model_description import ValidationError

_HOST: Any = fmpy
_NAME = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*(\[\d+(,\d+)*\])?", re.ASCII)


def problems_of(fmu: Path) -> list[str]:
    """Return what FMPy finds wrong, and names that are not those of structured variables.

    FMPy's own parser of names takes 10 ms for each; `validate_fmu` uses it, in test_model_description.py.
    """
    try:
        described = _HOST.read_model_description(str(fmu), validate=True, validate_model_structure=True)
    except ValidationError as e:
        return e.problems
    return [f"the name {v.name}" for v in described.modelVariables if not _NAME.fullmatch(v.name)]

"""An FMU with a manifest of related files (FMI-LS-REF): `decay.c` with an experiment and its result in closed form."""

import math
from collections.abc import Mapping
from pathlib import Path

from handover.cosim.experiments.manifest import FOLDER, MANIFEST
from support.cosim import decay

_ROOT = (
    '<fmiReferences xmlns:fmi-ls="http://fmi-standard.org/fmi-ls-manifest" '
    'fmi-ls:fmi-ls-name="org.fmi-standard.fmi-ls-ref" fmi-ls:fmi-ls-version="1.0.0-alpha.1" '
    'fmi-ls:fmi-ls-description="Layered Standard providing information on related files included in an FMU.">'
)
STIMULUS = '<Related type="text/csv" source="in.csv" role="experiment/smoke-test">{}</Related>'
RESULT = '<Related type="text/csv" source="out.csv" role="result"/>'
SETUP = (
    '<Annotations><Annotation type="handover.experiment"><Setup xmlns="urn:handover:experiment" result="out.csv" '
    'step="1/10" relative="{}" absolute="0">{}</Setup></Annotation></Annotations>'
)
INPUTS = "time,u\n0.0,0.0\n0.3,2.0\n1.0,2.0\n"


def outputs(error: float = 0.0) -> str:
    """Return the closed form of x' = u - x, x(0) = 1, u = 0 until 0.3 s and then 2; the last value is wrong."""
    times = [k / 10 for k in range(11)]
    at = math.exp(-0.3)
    values = [math.exp(-t) if t <= 0.3 else 2.0 + (at - 2.0) * math.exp(-(t - 0.3)) for t in times]
    values[-1] += error
    return "time,y\n" + "".join(f"{t!r},{y!r}\n" for t, y in zip(times, values, strict=True))


def manifest(*related: str) -> bytes:
    return f"{_ROOT}{''.join(related)}</fmiReferences>".encode()


def packed(folder: Path, content: bytes, files: Mapping[str, str] | None = None, library: bytes = b"") -> Path:
    others = {MANIFEST: content, **{f"{FOLDER}/{name}": text.encode() for name, text in (files or {}).items()}}
    return decay.pack(folder / "Decay.fmu", library, others=others)

"""Files of the VSL arm's learned models: their text, and the hash of the arm that they were trained on."""

import hashlib
import zipfile
from pathlib import Path

from handover.controllers.vsl.hybrid_kinematics import train_command
from handover.controllers.vsl.learned_model import VslModel
from handover.controllers.vsl.model_text import model_text

_MODULE = '''"""The trained model of `HybridKinematics` that ships, as JSON.

Generated; when the sources of the arm (plants/vsl/) have changed, run again

    {command} --points {points} --seed {seed} --out controllers/vsl/{name}
"""

DEFAULT_MODEL = """\\
{text}"""
'''


def content_key(fmu: Path) -> str:
    """Return a hash that changes if the sources of the arm do: those in `plants` that its FMU carries.

    Changes of engine and builder leave it as it is. Of an FMU without such sources it is the hash of all bytes.
    """
    digest = hashlib.sha256()
    with zipfile.ZipFile(fmu) as archive:
        names = [n for n in archive.namelist() if n.startswith("resources/sources/handover/plants/")]
        for name in sorted(names):
            content = archive.read(name)
            digest.update(f"{name}\0{len(content)}\0".encode() + content)
    if not names:
        digest.update(fmu.read_bytes())
    return digest.hexdigest()


def file_text(model: VslModel, path: Path) -> str:
    """Return the content of a model's file: a Python module if its name ends in .py, else JSON."""
    text = model_text(model)
    if path.suffix != ".py":
        return text
    provenance = model.provenance
    command = train_command(model.kind, model.kinematics, friction_compensation=model.friction != (0.0, 0.0))
    points, seed = provenance["points"]["measured"], provenance["seed"]
    return _MODULE.format(command=command, name=path.name, points=points, seed=seed, text=text)

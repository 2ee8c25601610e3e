"""Builds FMUs of FMI 2.0 or 3.0 for co-simulation, from the catalog's units or from any block class.

An FMU holds the model description, the unit's icon and terminals, a documentation page, the runtime in C, and the
Python sources that its block needs.
Its token and the prefix of its modules are hashes of its content, so that the same content gives the same file.
"""

import hashlib
import importlib.util
import json
import logging
import os
import sys
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from fractions import Fraction
from numbers import Rational
from pathlib import Path
from typing import Any

from handover.cosim.blocks.description import describe, with_start_values
from handover.cosim.exceptions import InvalidFmu
from handover.cosim.experiments import manifest as manifest_format
from handover.cosim.files import scratch_folder
from handover.cosim.fmu.file import archive as archive_format
from handover.cosim.fmu.file.archive import TERMINALS, FmuArchive, write_archive
from handover.cosim.fmu.file.icon import icon_files
from handover.fmus import interpreter
from handover.fmus.binaries import binaries
from handover.fmus.catalog import Entry, find_unit, import_class
from handover.fmus.compile import cache_folder, host_platform
from handover.fmus.contents.documentation import page
from handover.fmus.contents.fmi2_description import fmi2_description
from handover.fmus.contents.fmi3_description import fmi3_description
from handover.fmus.contents.icons import block_icon
from handover.fmus.contents.model_description import Model
from handover.fmus.contents.related_files import ParameterSet, related_files
from handover.fmus.contents.terminals import terminals_file
from handover.fmus.layout import Form, Layout
from handover.fmus.sources import Carried, beside_block, closure
from handover.fmus.standalone.freezer import PROGRAM, check_standalone, frozen
from handover.fmus.standalone.smoke_test import try_unit

_log = logging.getLogger(__name__)

_OUTSIDE = (manifest_format, archive_format)
"""Modules outside of this package whose constants and layout get into an FMU."""


@dataclass(frozen=True)
class ExperimentRequest:
    """What reference experiment is to be recorded: with the stimulus in a CSV file or, without one, the default."""

    stimulus: Path | None = None


class UnknownVersion(ValueError):
    """FMUs are built for FMI 2 and FMI 3 only."""

    def __init__(self, fmi: object) -> None:
        super().__init__(f"FMI version {fmi!r}; there are 2 (FMI 2.0) and 3 (FMI 3.0)")
        self.fmi = fmi


class InvalidName(ValueError):
    """An FMU's name is not an identifier in C, which FMI requires as it is also the name of its library."""

    def __init__(self, name: str) -> None:
        super().__init__(f"an FMU cannot be named {name!r}: a name consists of ASCII letters, digits and underscores")
        self.name = name


class InvalidStep(ValueError):
    """A communication step is not a positive, exact number of seconds."""

    def __init__(self, step: object) -> None:
        super().__init__(
            f"invalid communication step of {step!r} s: give an int or a Fraction above 0, such as Fraction(1, 100)"
        )
        self.step = step


def cached(name: str, fmi: int, *, scalar: bool = False, start: Mapping[str, Any] | None = None) -> Path:
    """Return a catalog unit's FMU; it is built if the cache has none of the present sources, see `build`.

    The cache is HANDOVER_CACHE, or the user's cache folder. Two processes may build the same unit concurrently. A file
    in it that is damaged is built again, with a line in the log.

    `start` are start values that differ from those of the catalog's unit, see `Entry`: an FMU with a token of its own,
    whose model description has them, and which starts from them in every host.

    Raises:
        UnknownUnit: no unit has this name.
        DeclarationError: the unit cannot start from such a value.
        NoFmi2Form: FMI 2 was asked for, but the unit has binary ports.
    """
    entry = replace(find_unit(name), start=start or {})
    carried = closure(entry.block)
    folder = _cache() / _content_key(entry, _form(fmi, scalar=scalar), carried)
    wanted = folder / file_name(entry.name, _form(fmi, scalar=scalar))
    if wanted.is_file():
        try:
            FmuArchive(wanted).verify()
        except InvalidFmu as e:
            _log.warning("%s is built again: %s", wanted, e.fault)
        else:
            return wanted
    return build(entry, fmi, folder, scalar=scalar)


def is_of_cache(fmu: Path) -> bool:
    """Return whether a file is one of those that `cached` returns."""
    return fmu.resolve().is_relative_to(_cache().resolve())


def _cache() -> Path:
    return cache_folder().absolute() / "fmus"


def build_block(
    block: str,
    fmi: int,
    out_dir: Path,
    *,
    step: Fraction = Fraction(1, 100),
    summary: str = "",
    name: str = "",
    scalar: bool = False,
    platforms: Sequence[str] | None = None,
    start: Mapping[str, Any] | None = None,
) -> Path:
    """Build an FMU of any block class, wherever its module lies.

    Args:
        block: path of the class, such as `package.module:Class`; its module must be importable.
        fmi: 2 or 3.
        out_dir: folder of the FMU.
        step: default communication step, in seconds.
        summary: one line of description; by default the first line of the class's docstring.
        name: the FMU's name; by default the class's.
        scalar: see `build`.
        platforms: see `build`.
        start: start values that differ from those that the block declares, see `Entry`.

    Raises:
        what `build` raises.
    """
    entry = Entry(name or block.rpartition(":")[2], block, step, summary, start or {})
    return build(entry, fmi, out_dir, scalar=scalar, platforms=platforms)


def build(
    entry: Entry,
    fmi: int,
    out_dir: Path,
    *,
    scalar: bool = False,
    platforms: Sequence[str] | None = None,
    standalone: bool = False,
    include: Sequence[Path] = (),
    parameter_sets: Sequence[ParameterSet] = (),
    experiment: ExperimentRequest | None = None,
) -> Path:
    """Build a unit's FMU. The same sources, packages and interpreter give the same bytes, unless it is standalone.

    Args:
        entry: the unit.
        fmi: 2 or 3.
        out_dir: folder of the FMU.
        scalar: make every entry of an array a variable of its own in FMI 3, for hosts without arrays; without effect
            in FMI 2, which has no arrays.
        platforms: for which the FMU has the runtime, such as `x86_64-windows`, or `host`, or `all`; by default all for
            which it is compiled.
        standalone: bring the interpreter and all packages along, for this machine's platform: nothing need be installed
            where the FMU is used. The unit is started in them, and steps once, before the FMU is written.
        include: data files that the block opens beside its module, by `__file__`.
        parameter_sets: that the FMU contains (FMI-LS-REF).
        experiment: the reference experiment that is recorded and stored with its result; it takes two to four runs.

    Raises:
        CannotRecordExperiment, InvalidTable: the experiment cannot be recorded, or its stimulus is none for this unit.
        InvalidParameterSet: a parameter set is not one for this unit.
        CannotFreeze: a standalone FMU cannot be made: PyInstaller is not installed, a platform is another one than this
            machine's, a package cannot be frozen, or the block opens files that the FMU does not have.
        FileElsewhere: a data file does not lie in the folder of the block's module, or below.
        UnknownBlock: the entry's block does not exist.
        UnknownVersion, InvalidName, InvalidStep: the standard's version, the name or the step is invalid.
        DeclarationError, DuplicateName, AmbiguousName, InvalidText: the block's declarations are invalid, or it cannot
            start from the entry's start values.
        InvalidIcon: the block's attribute `icon` names no picture.
        NoFmi2Form: FMI 2 was asked for, but the block has binary ports, or integers that start beyond 32 bits.
        UnknownPlatform: the runtime is not available for a platform.
        NotCompiled: there is no runtime and no compiler.
    """
    form = _form(fmi, scalar=scalar)
    if standalone:
        check_standalone(platforms)
    carried = closure(entry.block)
    if not (entry.name.isidentifier() and entry.name.isascii()):
        raise InvalidName(entry.name)
    _check_step(entry.step)
    icon = block_icon(entry)
    sources = {path: file.read_bytes() for path, file in carried.files.items()}
    sources |= {path: file.read_bytes() for path, file in beside_block(entry.block, include).items()}
    packages = carried.packages()
    describe_in_xml = fmi2_description if fmi == 2 else fmi3_description
    without_token = _model(entry, form, "")
    model = _model(entry, form, _token({**sources, "modelDescription.xml": describe_in_xml(without_token)}))
    unit = {
        "unit": entry.name,
        "block": entry.block,
        "form": form.value,
        "start": entry.start,
        "token": model.token,
        "prefix": f"_fmu_{_digest(sources)[:16]}",
        "packages": [asdict(package) for package in packages],
    }
    files = {
        "modelDescription.xml": describe_in_xml(replace(model, needs_python=not standalone)),
        **({TERMINALS: terminals_file(model)} if fmi == 3 or model.description.terminals else {}),
        "documentation/index.html": page(model, packages, host_platform() if standalone else ""),
        "resources/unit.json": json.dumps(unit, indent=2).encode() + b"\n",
        **{f"resources/sources/{path}": content for path, content in sources.items()},
        **icon_files(icon, fmi),
        **binaries(entry.name, fmi, ("host",) if standalone else platforms),
    }
    if standalone:
        files |= {f"resources/{path}": content for path, content in frozen(entry.block, carried).items()}
        try_unit(entry.name, files, model.token, float(entry.step))
    else:
        files["resources/python.txt"] = os.fsencode(interpreter.describe())
    programs = [f"resources/standalone/{host_platform()}/{PROGRAM}"] if standalone else []
    name = file_name(entry.name, form, standalone=standalone)
    source = f"resources/sources/{_source_of(entry.block, carried)}"
    files |= related_files(model, source, parameter_sets)
    if experiment is not None:
        from handover.fmus.contents.reference_experiment import record_experiment  # loads FMPy, which takes long

        with scratch_folder("experiment") as scratch:
            recorded = record_experiment(
                write_archive(scratch / name, files, programs), entry.step, experiment.stimulus
            )
        files |= related_files(model, source, parameter_sets, recorded)
    return write_archive(out_dir / name, files, programs)


def _source_of(block: str, carried: Carried) -> str:
    """Return the path of a block's own module among the sources that its FMU carries."""
    path = block.partition(":")[0].replace(".", "/")
    return f"{path}.py" if f"{path}.py" in carried.files else f"{path}/__init__.py"


def _check_step(step: object) -> None:
    exact = Fraction(step) if isinstance(step, Rational) else Fraction(0)
    if not sys.float_info.min <= exact <= sys.float_info.max:
        raise InvalidStep(step)


def file_name(name: str, form: Form, *, standalone: bool = False) -> str:
    """Return the name of a unit's file, such as `TendonArm.fmi3.fmu` or `TendonArm.fmi3-standalone.fmu`."""
    return f"{name}.{form.value}{'-standalone' if standalone else ''}.fmu"


def _form(fmi: int, *, scalar: bool) -> Form:
    if fmi not in (2, 3):
        raise UnknownVersion(fmi)
    return Form.FMI2 if fmi == 2 else Form.FMI3_SCALAR if scalar else Form.FMI3


def _model(entry: Entry, form: Form, token: str) -> Model:
    block = import_class(entry.block)
    description = with_start_values(describe(block), entry.start)
    return Model(
        name=entry.name,
        summary=entry.summary or description.doc.partition("\n")[0],
        step=entry.step,
        token=token,
        description=description,
        layout=Layout(description),
        form=form,
        variable_step=description.period is None and getattr(block, "variable_step", True),
    )


def _content_key(entry: Entry, form: Form, carried: Carried) -> str:
    """Return a hash of all that an FMU depends on: sources, packages, interpreter, runtime, and the builder itself."""
    here = Path(__file__).parent
    own = [file for folder in (here, here / "contents") for file in sorted(folder.glob("*.*"))]
    builder = [*own, *(Path(m.__file__ or "") for m in _OUTSIDE)]
    parts = {path: file.read_bytes() for path, file in carried.files.items()}
    parts |= {f"builder/{file.parent.name}/{file.name}": file.read_bytes() for file in builder if file.is_file()}
    parts |= icon_files(block_icon(entry), form.fmi)
    parts |= binaries(entry.name, form.fmi)
    parts |= {f"environment/{module}": _version_mark(module) for module in carried.modules}
    parts |= {"interpreter": os.fsencode(interpreter.describe()), "entry": repr((entry, form)).encode()}
    return _digest(parts)


def _version_mark(module: str) -> bytes:
    """Return a package's file and its modification time: looking up its version would take longer."""
    spec = importlib.util.find_spec(module)
    origin = Path(spec.origin) if spec and spec.origin else None
    return f"{origin} {origin.stat().st_mtime_ns if origin and origin.is_file() else ''}".encode()


def _digest(parts: Mapping[str, bytes]) -> str:
    digest = hashlib.sha256()
    for name, content in sorted(parts.items()):
        digest.update(f"{name}\0{len(content)}\0".encode() + content)
    return digest.hexdigest()


def _token(parts: Mapping[str, bytes]) -> str:
    return f"{{{uuid.UUID(_digest(parts)[:32])}}}"

"""`--config FILE`: values of a command's options from a TOML or JSON file, or the `run.json` of a run to be repeated.

Keys are the options as they are typed, without dashes in front; `scenario` is what is run. `-p`, `--unit` and the
values to vary are tables by name: `parameters`, `unit` and, of `handover sweep`, `sweep`. The command line comes first,
of these tables name by name.
"""

import contextlib
import json
from collections import Counter
from collections.abc import Callable, Container, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import click
import tomli
from click.core import ParameterSource

from handover.cosim.exceptions import MOST_FAULTS, first_faults, nearest, one_line
from handover.cosim.files import read_regular, reading_fault
from handover.cosim.ssp.archive import ssp_root
from handover.cosim.typed_data import checked, decoded
from handover.fmus.build import is_of_cache
from handover.fmus.catalog import UNITS
from handover.scenarios.catalog import InvalidScenario, ScenarioSource, named_scenario
from handover.scenarios.cli.master_options import CONTROL_FIELDS
from handover.scenarios.cli.options import PATH, HeadedCommand
from handover.scenarios.experiment.parameters import InvalidParameter, idle_parameters
from handover.scenarios.runs.execution.errors import UsageError
from handover.scenarios.runs.execution.progress import say
from handover.scenarios.runs.execution.request import experiment_type, is_file
from handover.scenarios.runs.execution.selection import is_path_of_class
from handover.scenarios.runs.execution.unit_values import split_parameters
from handover.scenarios.runs.results.folder_data import RunData
from handover.scenarios.runs.results.run_folder import sha256_of, version_differences, versions

_META = "handover.config"
_TABLES = {"parameters": "parameters", "unit": "replaced", "sweep": "grid"}
"""Keys that are tables by name, and the parameters of commands that take them as texts `NAME=VALUE`."""
_NOT_KEPT = ("help", "config")
_OF_RUN_JSON = {"scenario", "parameters", "files", "master", "versions"}


@dataclass(frozen=True)
class ConfigFile:
    """What a file gives to a command.

    Attributes:
        path: the file.
        defaults: values for click's options, by the names of its parameters.
        texts: texts `NAME=VALUE`, by the names of click's parameters.
        run: the content of a `run.json`; None for a file of options.
    """

    path: Path
    defaults: Mapping[str, Any] = field(default_factory=dict[str, Any])
    texts: Mapping[str, Sequence[str]] = field(default_factory=dict[str, Sequence[str]])
    run: Mapping[str, Any] | None = None

    def merge_into(self, ctx: click.Context) -> None:
        """Put the file's texts before those of the command line, without names that this gives.

        Where the file names the scenario, the first argument of a sweep may be `NAME=VALUES`. Code that the file names,
        and that is not this package's, is said on standard error; that of a `run.json` has to be what the run had.

        Raises:
            UsageError: it is other code, or an FMU is not there.
        """
        params, from_file = ctx.params, "scenario" in self.defaults
        if "grid" in params and "=" in params["scenario"] and from_file:
            params["grid"] = (params["scenario"], *params["grid"])
            params["scenario"] = self.defaults["scenario"]
        elif ctx.get_parameter_source("scenario") is ParameterSource.COMMANDLINE:
            from_file = False
        given: dict[str, Sequence[str]] = {name: params[name] for name in _TABLES.values() if name in params}
        varied_or_set = {_name(t) for name in ("parameters", "grid") for t in given.get(name, ())}
        units = {_name(t) for t in given.get("replaced", ())}
        with _damage_reported(self.path):
            self._say(_own_code(self.path, self.run, str(params["scenario"])) if from_file else [])
            of_file = self.texts.get("replaced", ())
            has_units = self.run is not None and "replaced" in params
            replaced = _units(self.path, self.run or {}, units) if has_units else [*of_file]
        replaced = [text for text in replaced if _name(text) not in units]
        for name, texts in given.items():
            texts_of_file = replaced if name == "replaced" else self.texts.get(name, ())
            params[name] = (*(t for t in texts_of_file if name == "replaced" or _name(t) not in varied_or_set), *texts)
        if self.run is not None and "grid" not in params:
            self._leave_out_idle(params, varied_or_set)
        self._say(text for text in replaced if _is_own(text.partition("=")[2]))

    def _leave_out_idle(self, params: dict[str, Any], typed: Container[str]) -> None:
        """Leave out what a `run.json` has of parameters of which nothing comes, as in a point of a campaign."""
        with contextlib.suppress(UsageError, InvalidParameter):  # the command finds the same faults
            kind = experiment_type(params["scenario"])
            idle = idle_parameters(kind, split_parameters(kind, params["parameters"])[0])
            texts: Sequence[str] = params["parameters"]
            params["parameters"] = tuple(t for t in texts if _name(t) in typed or _name(t) not in idle)

    def _say(self, own_code: Iterable[str]) -> None:
        """Say which code that is not this package's is about to be run."""
        for line in own_code:
            say(f"{self.path}: this runs {line}")


class ConfiguredCommand(HeadedCommand):
    """A command with `--config`, see `config_option`; what cannot be run is refused with the name of the file."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the command line and add what the file gives."""
        rest = super().parse_args(ctx, args)
        if (config := ctx.meta.get(_META)) is not None:
            config.merge_into(ctx)
        return rest

    def invoke(self, ctx: click.Context) -> Any:
        """Call the command."""
        try:
            return super().invoke(ctx)
        except UsageError as e:
            if (config := ctx.meta.get(_META)) is None:
                raise
            raise UsageError(f"with {config.path}: {e.message}") from e


def config_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add `--config`, to a `ConfiguredCommand`."""
    return click.option(
        "--config",
        type=PATH,
        metavar="FILE",
        is_eager=True,
        expose_value=False,
        callback=_take,
        help="TOML or JSON file with values of these options, keys as they are typed without dashes: `seed = 3`, tables"
        " `parameters`, `unit`, of a sweep `sweep`, and `scenario`. The command line comes first. A run's run.json"
        " repeats that run.",
    )(command)


def _take(ctx: click.Context, _option: click.Parameter, path: Path | None) -> None:
    if path is None or ctx.resilient_parsing:
        return
    config = read_config(path, ctx)
    ctx.meta[_META] = config
    ctx.default_map = {**(ctx.default_map or {}), **config.defaults}


def read_config(path: Path, ctx: click.Context) -> ConfigFile:
    """Read and check a file for the command of a context.

    Raises:
        UsageError: it cannot be read, or with all keys that are unknown or whose values are not right.
    """
    content = _content(path)
    if path.name == "summary.json" and (run_file := path.with_name("run.json")).is_file():
        raise UsageError(f"{path}: it has a run's results and no options; {run_file} repeats the run")
    options = dict(_options(ctx.command))
    tables = {key: name for key, name in _TABLES.items() if name in {p.name for p in ctx.command.params}}
    run: Mapping[str, Any] | None = None
    if content.keys() >= _OF_RUN_JSON:
        run = content
        content = {key: value for key, value in _of_run(path, content).items() if key in {**options, **tables}}
    faults: list[str] = []
    defaults: dict[str, Any] = {}
    texts: dict[str, Sequence[str]] = {}
    for key, value in content.items():
        try:
            if key in tables:
                texts[tables[key]] = list(_texts(key, value))
            elif key in options and options[key].name in defaults:
                faults.append(f"{key}: another spelling of it is given, too; give one of them")
            elif key in options:
                defaults[str(options[key].name)] = _checked(options[key], ctx, value)
            elif key in _TABLES:
                faults.append(f"no option {key!r}; the table [{key}] is for `handover sweep`")
            elif key == "p":
                faults.append("no option 'p'; the table [parameters] has what -p sets")
            else:
                hint = nearest(key, {**options, **tables}) if len(faults) < MOST_FAULTS else ""
                faults.append(f"no option {key!r}; {hint}")
        except click.BadParameter as e:
            faults.append(f"{key} = {_short(value)}: {e.message.rstrip('.')}")
        except ValueError as e:
            faults.append(one_line(e))
    if faults:
        raise UsageError(f"{path}: {'; '.join(first_faults(faults))}")
    return ConfigFile(path, defaults, texts, run)


def _content(path: Path) -> dict[str, Any]:
    form, example = ("JSON", '{"seed": 3}') if path.suffix.lower() == ".json" else ("TOML", "seed = 3")
    try:
        text = read_regular(path).decode("utf-8-sig")
        if form == "TOML":
            return tomli.loads(text)
        content = decoded(text, dict[str, Any])
        json.loads(text, object_pairs_hook=_without_repeats)
        return content
    except OSError as e:
        raise UsageError(f"{path}: {reading_fault(e)}") from e
    except (ValueError, RecursionError) as e:  # of both parsers, and of bytes that are not UTF-8
        raise UsageError(f"{path}: it is not {form} of options, such as {example}: {one_line(e)}") from e


def _without_repeats(pairs: Sequence[tuple[str, Any]]) -> None:
    """Reject keys that are given twice, of which JSON takes the last.

    Raises:
        ValueError: there are some.
    """
    if twice := [name for name, count in Counter(name for name, _ in pairs).items() if count > 1]:
        raise ValueError(f"{', '.join(first_faults([repr(name) for name in twice]))} given twice in one table")


def _options(command: click.Command) -> Iterator[tuple[str, click.Parameter]]:
    """Yield the options that a file can give, by their keys."""
    for parameter in command.params:
        if parameter.name in _TABLES.values() or getattr(parameter, "hidden", False):
            continue
        names = parameter.opts if isinstance(parameter, click.Option) else [f"--{parameter.name}"]
        for name in names:
            if name.startswith("--") and name[2:] not in _NOT_KEPT:
                yield name[2:], parameter


def _checked(option: click.Parameter, ctx: click.Context, value: Any) -> Any:
    """Return an option's value as click takes it.

    Raises:
        BadParameter: it is none.
    """
    if isinstance(option, click.Option) and option.is_flag:
        if not isinstance(value, bool):
            raise click.BadParameter("expected true or false")
        return value
    several = isinstance(option, click.Option) and option.multiple
    values = cast(list[Any], value) if several and isinstance(value, list) else [value]
    is_text = isinstance(option.type, (click.types.StringParamType, click.Path, click.Choice))
    if any(isinstance(v, bool) or not isinstance(v, str if is_text else (str, int, float)) for v in values):
        right = "a text in quotes" if is_text else "a number, or a text that is one"
        raise click.BadParameter(f"expected {right}" + (", or several in [...]" if several else ""))
    texts = [_text(v) for v in values]
    given = texts if several else texts[0]
    option.type_cast_value(ctx, given)
    return given


def _texts(key: str, table: Any) -> Iterator[str]:
    """Yield the texts `NAME=VALUE` of a table.

    Raises:
        ValueError: it is none, or has a value of another type.
    """
    if not isinstance(table, dict):
        raise ValueError(f"{key} = {_short(table)}: expected a table by name, such as [{key}]")
    for name, value in _leaves(cast(dict[str, Any], table)):
        entries = list(_flat(value))
        if any(not isinstance(v, (str, int, float)) for v in entries):
            raise ValueError(f"{key}.{name} = {_short(value)}: expected texts, numbers, true, false and lists of them")
        if key == "unit" and any(not isinstance(v, str) for v in entries):
            raise ValueError(f"{key}.{name} = {_short(value)}: expected a text in quotes")
        if key != "sweep" or not isinstance(value, list):
            yield f"{name}={','.join(map(_text, entries))}"
            continue
        texts = [",".join(map(_text, _flat(item))) for item in cast(list[Any], value)]
        yield f"{name}={(';' if any(',' in text for text in texts) else ',').join(texts)}"


def _flat(value: Any) -> Iterator[Any]:
    """Yield the entries of an array, or a single value."""
    if isinstance(value, list):
        for entry in cast(list[Any], value):
            yield from _flat(entry)
    else:
        yield value


def _leaves(table: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values of a table, and of tables in it, by names with points between."""
    for name, value in table.items():
        if isinstance(value, dict):
            yield from _leaves(cast(dict[str, Any], value), f"{before}{name}.")
        else:
            yield f"{before}{name}", value


def _text(value: str | float) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value) if isinstance(value, float) else str(value)


def _short(value: Any) -> str:
    text = json.dumps(value, default=str)
    return text if len(text) <= 40 else f"{text[:37]}..."


def _name(text: str) -> str:
    return text.partition("=")[0].strip()


def _of_run(path: Path, run: Mapping[str, Any]) -> dict[str, Any]:
    """Return what repeats a run, from its `run.json`, but for its units; tell of files and versions that are others.

    Raises:
        UsageError: it is damaged.
    """
    with _damage_reported(path):
        checked(run, RunData)
        if other := version_differences(versions(), run["versions"]):
            say(f"{path}: the run was of other versions: {other}")
        content: dict[str, Any] = {**_subject(run), **_of_master(run["master"])}
        content |= {"seed": run["seed"], "stop": run.get("stop", content.get("stop"))}
        content |= {"checkpoint": run["checkpoint"], "format": run["formats"], "record": run.get("recorded")}
        content["parameters"] = {**run["parameters"], **run.get("unit_values", {}), **content.get("parameters", {})}
        for file in run.get("parameter_files", {}).values():
            if Path(file["file"]).is_file() and not _is_unchanged(Path(file["file"]), file["sha256"]):
                say(f"{path}: {file['file']} is not the file that the run had")
    return {key: value for key, value in content.items() if value is not None}


@contextlib.contextmanager
def _damage_reported(path: Path) -> Generator[None, None, None]:
    """Raise UsageError where what a `run.json` has is of another form."""
    try:
        yield
    except (KeyError, TypeError, ValueError, AttributeError) as e:
        raise UsageError(f"{path}: it is damaged: {type(e).__name__} {one_line(e)}") from e


def _subject(run: Mapping[str, Any]) -> dict[str, Any]:
    source = run["source"]
    if not source:
        return {"scenario": run["scenario"]}
    if "scenario" in source:
        return {"scenario": source["scenario"]}
    file = source["ssp"] if "ssp" in source else source["fmu"]
    given = dict(tuple(part.strip() for part in text.split("=", 1)) for text in source.get("parameters", ()))
    return {"scenario": file, "input": source.get("input"), "step": source["step"], "parameters": given} | {
        "start": source.get("start"),
        "stop": source["stop"],
    }


def _own_code(path: Path, run: Mapping[str, Any] | None, subject: str) -> list[str]:
    """Return which code a file names as what is to be run, that is not this package's: a line, or none.

    Raises:
        UsageError: it is not what the run had, in whose `run.json` it is.
    """
    if run is None:
        return [f"the code of {subject}"] if _is_own(subject) else []
    source = run["source"]
    cure = f"name it to run it all the same: {subject} --config {path}"
    if "scenario" not in source:
        if not _is_own(subject):
            return []
        if is_path_of_class(subject) or not _is_unchanged(ssp_root(Path(subject)), source.get("sha256")):
            raise UsageError(f"{path}: {subject} is not the file that the run had; {cure}")
        return [f"the units in {subject}"]
    before = ScenarioSource(**source)
    try:
        return [f"the code of {before.scenario}: {before.unchanged_file()}, as the run had it"]
    except KeyError:
        raise UsageError(f"{path}: its scenario {before.scenario} is not installed here") from None
    except InvalidScenario as e:
        raise UsageError(f"{path}: its scenario {one_line(e)}; {cure}") from e


def _is_own(name: str) -> bool:
    """Return whether what is named runs code that is not this package's: a class by its path, or a file."""
    return is_path_of_class(name) or (is_file(name) and not is_of_cache(Path(name)))


def _of_master(master: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options of the master, from `MasterOptions.as_data`."""
    control: Mapping[str, Any] = master.get("adaptive") or {}
    options = {key: master[key] for key in ("algorithm", "tolerance", "iterations", "extrapolation")}
    options |= {"repeat-discarded": master["repeat_discarded"], "isolate": master.get("isolated")}
    options["unit-tolerance"] = [f"{name}={number}" for name, number in master.get("unit_tolerances", {}).items()]
    options |= {option.replace("_", "-"): control.get(name) for option, name in CONTROL_FIELDS.items()}
    return {**options, "adaptive": control.get("relative")}


def _units(path: Path, run: Mapping[str, Any], given: Container[str]) -> list[str]:
    """Return texts `NAME=FILE` of the FMUs of a run's units; those of the catalog that are gone are built again.

    Args:
        path: the `run.json`.
        run: its content.
        given: units that the command line gives.

    Raises:
        UsageError: another one is not there, or is not what the run had.
    """
    texts: list[str] = []
    for name, file in run["files"].items():
        if name in given:
            continue
        of_cache, unit = is_of_cache(Path(file)), Path(file).name.partition(".")[0]
        if _is_unchanged(Path(file), run["units"].get(name, {}).get("sha256")):
            texts.append(f"{name}={Path(file).absolute()}")
        elif of_cache and unit in UNITS:
            texts.append(f"{name}={unit}")
        elif not of_cache or unit != _own_unit(run, name):
            fault = "is not the file that the run had" if Path(file).exists() else "is not there"
            cure = f"--unit {name}=FILE or {name}=MODULE:CLASS gives another"
            raise UsageError(f"{path}: the FMU of its unit {name}, {file}, {fault}; {cure}")
    return texts


def _own_unit(run: Mapping[str, Any], name: str) -> str:
    """Return the class of the own scenario's own unit of a name; "" where its code is not what the run had."""
    try:
        source = ScenarioSource(**run["source"])
        source.unchanged_file()
        return named_scenario(source.scenario).units.get(name, "").rpartition(":")[2]
    except (KeyError, TypeError, InvalidScenario):
        return ""


def _is_unchanged(file: Path, sha256: str | None) -> bool:
    return file.exists() and sha256_of(file) == sha256

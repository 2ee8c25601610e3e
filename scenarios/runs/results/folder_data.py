"""What a run's `run.json` (what was run) and `summary.json` (how it went) hold, as they are written and read.

Only some entries must be there, as other versions wrote fewer; those that are there must be of the declared types.
"""

from typing import Annotated, Any, Literal

from msgspec import Meta
from typing_extensions import NotRequired, TypedDict

from handover.cosim.fmu.unit_warnings import WarningData
from handover.cosim.stepping.options import Algorithm
from handover.cosim.typed_data import Count, ExactSeconds, ExactTime, FilePath, NotNegative, PortName, Seed
from handover.scenarios.runs.results.output_faults import NotFiniteData, OutOfRangeData


class AdaptiveData(TypedDict):
    """Step control, as in `MasterOptions.as_data`."""

    relative: float
    absolute: float
    initial: NotRequired[ExactSeconds | None]
    smallest: NotRequired[ExactSeconds | None]
    largest: NotRequired[ExactSeconds | None]


class MasterData(TypedDict):
    """Options of the master, as of `MasterOptions.as_data`."""

    algorithm: Annotated[str, Meta(pattern=f"^({'|'.join(a.value for a in Algorithm)})$")]
    tolerance: float
    iterations: Count
    extrapolation: str
    adaptive: AdaptiveData | None
    repeat_discarded: bool
    isolated: NotRequired[list[str]]
    unit_tolerances: NotRequired[dict[str, float]]


class _OfSomeConfigurations(TypedDict, total=False):
    unit_values: dict[str, str]
    stop: ExactTime | None
    recorded: list[str]
    inputs: dict[str, Any]


class Configuration(_OfSomeConfigurations):
    """What determines a run's signals; `seed` is None where nothing is random.

    `unit_values`, `stop`, s, `recorded`, and `inputs`, where those from outside came from, are there only if some are
    given, see `Task`.
    """

    scenario: str
    parameters: dict[str, Any]
    seed: NotRequired[Seed | None]
    master: NotRequired[MasterData]


class MetricData(TypedDict):
    """A metric. Values that are not finite are None, since JSON has neither infinity nor NaN."""

    value: float | None
    unit: str
    description: NotRequired[str]


class UnitData(TypedDict):
    """A unit's FMU and step in words, its number of steps and its CPU time, None where unknown."""

    name: str
    model: str
    step: str
    steps: Count | None
    cpu_seconds: NotNegative | None


class StepsData(TypedDict):
    """As of `StepStatistics`."""

    accepted: Count
    rejected: Count
    shortest: NotNegative
    longest: NotNegative


class PaceData(TypedDict):
    """As of `PaceReport`."""

    pace: NotNegative | None
    deadlines: Count
    missed: Count
    largest_lateness: float
    latest_at: float | None
    reached: NotRequired[NotNegative | None]
    changed: NotRequired[bool]
    first: NotRequired[NotNegative | None]


class FailureData(TypedDict, total=False):
    """As of `UnitFailure.as_data`."""

    kind: str
    instance: str | None
    call: str | None
    time: float
    status: str
    log: list[str]


class _OfSomeSummaries(TypedDict, total=False):
    steps: StepsData
    pace: PaceData
    ended: FailureData
    warnings: list[WarningData]
    not_finite: list[NotFiniteData]
    out_of_range: list[OutOfRangeData]
    left_out: list[str]


class Summary(_OfSomeSummaries):
    """How a run went: one that is not `complete` can be resumed; `failure` is None where no unit failed.

    Runs with adaptive steps have `steps`; those paced by real time `pace`; those that a unit ended its request in
    `ended`. `warnings` has the calls that answered Warning, by unit, and `not_finite` the outputs that are NaN or
    infinite in the record, where there are any; `out_of_range` has those beyond the ranges that their
    FMUs declare. `left_out` says, a line each, which figures, pictures or parts of the
    report could not be made. Of `Configuration` it has all.
    """

    scenario: NotRequired[str]
    parameters: NotRequired[dict[str, Any]]
    seed: NotRequired[Seed | None]
    master: NotRequired[MasterData]
    unit_values: NotRequired[dict[str, str]]
    stop: NotRequired[ExactTime | None]
    recorded: NotRequired[list[str]]
    inputs: NotRequired[dict[str, Any]]
    complete: NotRequired[bool]
    success: bool
    reason: str
    metrics: dict[str, MetricData]
    simulated_seconds: NotRequired[float]
    wall_seconds: NotRequired[NotNegative]
    cpu_seconds: NotRequired[NotNegative]
    units: NotRequired[list[UnitData]]
    failure: NotRequired[FailureData | None]


class IconData(TypedDict):
    """A unit's icon."""

    type: str
    base64: str


class DrawnUnitData(TypedDict):
    """A unit of the system, for its graph."""

    name: str
    model: str
    fmi: str
    period: NotNegative | None
    sampled: bool
    icon: NotRequired[IconData]


class ConnectionData(TypedDict):
    """A connection of the system, for its graph."""

    source: PortName
    target: PortName
    unit: str
    size: Count
    kind: str


class SystemData(TypedDict, total=False):
    """The units and connections of a system, as of `describe_system`."""

    units: list[DrawnUnitData]
    connections: list[ConnectionData]


class ConversionData(TypedDict):
    """A connection that converts units of measurement."""

    source: PortName
    unit: str
    target: PortName
    target_unit: str
    factor: float
    offset: float


class FileData(TypedDict):
    """A file that a run read, with its hash."""

    file: FilePath
    sha256: str


class FmuData(TypedDict):
    """A unit's FMU by the name of its file, with its hash."""

    fmu: str
    sha256: str


class SourceData(TypedDict, total=False):
    """Where a scenario, an SSP or an FMU that was run is found: see `ScenarioSource`, `source_of` and `FmuRun`."""

    scenario: str
    folder: str
    ssp: FilePath
    fmu: FilePath
    sha256: str
    start: ExactTime
    stop: ExactTime
    step: ExactSeconds | None
    parameters: list[str]
    input: FilePath
    input_sha256: str


class ExperimentData(TypedDict, total=False):
    """What units got as they were initialised: times, s, and the tolerances of their solvers."""

    start: float
    stop: float | None
    tolerances: dict[str, float]


class _OfSomeRuns(TypedDict, total=False):
    system: SystemData
    conversions: list[ConversionData]
    warnings: list[str]
    notes: list[str]
    external_inputs: list[PortName]
    failure: FailureData | None
    parameter_files: dict[str, FileData]
    source: SourceData
    files: dict[str, FilePath]
    formats: list[Literal["parquet", "csv", "mat"]]
    checkpoint: ExactSeconds | None
    title: str
    headline: list[str]
    told_parameters: list[tuple[str, str, str]]
    units: dict[str, FmuData]
    versions: dict[str, str]
    experiment: ExperimentData


class RunData(Configuration, _OfSomeRuns):
    """What another process needs to resume a run, or to present it: see `Task` and `Experiment`.

    A run that started has `system` and `conversions`, `warnings` of its FMUs if there are any, `notes` on what its
    units do not have and the wiring leaves out, and the names of `external_inputs`, which came from outside; one that
    could not start has `failure`; `units` are the FMUs' names and hashes; `parameter_files` has those of the files that
    parameters name, by these, where there are any. `experiment` is what the units got as they were
    initialised: `start` and `stop`, s, the latter as far as their steps reach, and by unit `tolerances` of its solver.
    """

"""An array that an SSP takes apart runs as any other, entry by entry."""

from fractions import Fraction
from pathlib import Path

from ssp_of import component, connection, connectors, described, pack_ssp, system

from handover.cosim.master.master import Master
from handover.cosim.ssp.ssp_file import SspFile
from handover.cosim.system.signals import Signals
from handover.fmus.build import build_block

STEP = Fraction(1, 10)


def test_entries_that_are_swapped_arrive_swapped(tmp_path: Path):
    fmus = {
        f"resources/{name}.fmu": build_block(f"master_blocks:{name}", 3, tmp_path, step=STEP, scalar=True)
        for name in ("Counter", "Echo")
    }
    gives, takes = ({f"pair[{k}]": kind for k in (1, 2)} for kind in ("output", "input"))
    elements = component("counter", connectors(**gives), "resources/Counter.fmu")
    elements += component("echo", connectors(**takes), "resources/Echo.fmu")
    transformed = '<ssc:LinearTransformation factor="-2" offset="0.5"/>'
    crossed = connection("counter.pair[1]", "echo.pair[2]") + connection("counter.pair[2]", "echo.pair[1]", transformed)
    seen: list[tuple[float, ...]] = []

    def observe(t: float, signals: Signals) -> None:  # noqa: ARG001
        seen.append(tuple(float(signals[n]) for n in ("counter.pair[1]", "counter.pair[2]")))
        seen[-1] += tuple(signals["echo.pair_back"].tolist())

    description = described(system(elements, crossed), version="2.0")
    with SspFile(pack_ssp(tmp_path / "a.ssp", description, fmus)) as ssp, Master(ssp.system) as master:
        master.run(Fraction(1, 2), [observe])
    assert seen == [(float(k), float(k * k), 0.5 - 2.0 * k * k, float(k)) for k in range(6)]

"""The command `handover flyer-track`: the track of the hand in a run, to lead the hand of other runs."""

from pathlib import Path

import click

from handover.scenarios.cli.options import PATH
from handover.scenarios.runs.execution.errors import UsageError, one_line_errors
from handover.scenarios.runs.results.run_folder import RunFolder, check_place, make_folder_of, replacing

_SIGNALS = ("person.p_WH_goal", "person.q_WH_goal", "person.finger_goal", "person.closed_goal")


@click.command("flyer-track")
@click.argument("folder", metavar="DIR", type=PATH)
@click.option(
    "--out",
    type=PATH,
    default=Path("hand_track.csv"),
    show_default=True,
    help="File for the track; one of that name is replaced.",
)
def flyer_track(folder: Path, out: Path) -> None:
    """Write the track of the hand in a handover of the free-flyer, of the run in DIR.

    It is where person or hand tracker wanted the hand: a table of times, poses, 14 joints' angles and whether the hand
    grasps. `-p hand_track=FILE` leads the hand by it.
    """
    with one_line_errors():
        run = RunFolder.of_run(folder)
        if not run.signals.is_file():
            raise UsageError(f"{folder} has no {run.signals.name}; name the folder of a run")
        if out.is_dir():
            raise UsageError(f"{out} is a folder; name a file for the track")
        check_place(out.absolute().parent)
        rows = _write(run, out)
    click.echo(f"track: {out}, {rows} rows")


def _write(run: RunFolder, out: Path) -> int:
    """Write where person or tracker wanted the hand, without what arm and object made of it; return the rows.

    Raises:
        UsageError: the run has no such signals, or the file cannot be written.
    """
    from handover.cosim.record.reader import Record  # pyarrow is slow to import
    from handover.plants.free_flyer.hand.hand_track import HandPose, write_track

    record = Record(run.signals)
    if lacking := [name for name in _SIGNALS if name not in record]:
        raise UsageError(f"{run.shown}: the run has no {', '.join(lacking)}; a handover by one free-flyer has")
    p, q, angles, closed = (record[name].tolist() for name in _SIGNALS)
    poses = (HandPose(tuple(a), tuple(b), tuple(c), bool(d)) for a, b, c, d in zip(p, q, angles, closed, strict=True))
    make_folder_of(out)
    try:
        with replacing(out) as unfinished:
            write_track(unfinished, zip(record.time.tolist(), poses, strict=True))
    except OSError as e:
        raise UsageError(f"{out} cannot be written: {e.strerror}") from e
    return len(record.time)

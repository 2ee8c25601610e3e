"""The command `handover flyer-track`: the track of the hand in a run, to lead the hand of other runs."""

from pathlib import Path

import click

from handover.scenarios.execution.errors import UsageError, one_line_errors
from handover.scenarios.results.run_folder import RunFolder, check_place

_PATH = click.Path(path_type=Path)


@click.command("flyer-track")
@click.argument("folder", metavar="DIR", type=_PATH)
@click.option(
    "--out",
    type=_PATH,
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
    from handover.cosim.record.reader import Record  # pyarrow is slow to import
    from handover.scenarios.free_flyer.recorded_hand import NoHand, write_hand_track

    try:
        return write_hand_track(Record(run.signals), out)
    except NoHand as e:
        raise UsageError(f"{run.shown}: {e}") from e

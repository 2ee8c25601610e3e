"""Carries out a study's sessions: the server of its page, its folder, and scripts in the place of people."""

import asyncio
import contextlib
import socket
from collections.abc import Callable
from pathlib import Path

from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.study.folder.study_folder import StudyFolder
from handover.scenarios.study.plan.plan import NOT_OFFERED, TRACKER, StudyPlan
from handover.scenarios.study.session.pilot import play_sessions
from handover.scenarios.study.session.protocol import Protocol
from handover.scenarios.study.session.seat import StudySeat
from handover.scenarios.study.session.server import StudyServer, listening_socket, uvicorn_server
from handover.scenarios.study.session.trial import NoHand, led_hand_of, round_parameters


class NotServed(RuntimeError):
    """A study that cannot be served as it was asked for."""


async def serve_study(
    plan: StudyPlan,
    out: Path,
    *,
    host: str,
    port: int,
    number: int | None,
    pace: float,
    pilot: bool,
    tell: Callable[[str], None],
) -> None:
    """Serve a study's page until it is ended, or until all scripted pilots have taken part.

    Args:
        plan: the study's.
        out: its folder, new, or one that goes on.
        host: the address on which it listens.
        port: likewise; 0: any that is free.
        number: the first participant's; None: whose session is not complete, or else the next.
        pace: simulated seconds per second of wall time.
        pilot: whether scripts take part.
        tell: is given lines for who carries it out.

    Raises:
        NotServed: the address cannot be used, or in a scenario nobody outside can lead a hand.
        InvalidRunFolder, RecordNotWritten: see `StudyFolder.opened`.
    """
    check_hands(plan)
    study = StudyFolder.opened(out, plan)
    with study.held():
        seat = StudySeat(Protocol(study, devices_here(plan), number), pace)
        server = StudyServer(seat, host)
        try:
            listening = listening_socket(host, port)
        except OSError as e:
            raise NotServed(f"--host {host} --port {port}: it cannot listen there: {e.strerror or e}") from e
        with listening:
            address = address_of(listening, server)
            tell(f"study: {address}  (results in {out}; Ctrl-C ends it)")
            if TRACKER in plan.devices:
                tell(f"a hand tracker connects to {address.replace('http', 'ws', 1)}hand")
            if pilot:
                await _with_pilots(server, listening, address, tell)
            else:
                await uvicorn_server(server).serve(sockets=[listening])


def check_hands(plan: StudyPlan) -> None:
    """Check that in each round of a plan somebody outside leads a hand.

    Raises:
        NotServed: with all rounds in which that is not so.
    """
    faults: list[str] = []
    for c in plan.conditions:
        try:
            led_hand_of(c.scenario, round_parameters(c))
        except (NoHand, InvalidParameter) as e:
            faults.append(f"tasks.{c.task}, {c.behaviour}: {e}")
    if faults:
        raise NotServed("; ".join(dict.fromkeys(faults)))


async def _with_pilots(
    server: StudyServer, listening: socket.socket, address: str, tell: Callable[[str], None]
) -> None:
    serving = uvicorn_server(server)
    job = asyncio.create_task(serving.serve(sockets=[listening]))
    playing = asyncio.create_task(play_sessions(address, server.seat.protocol.study.plan, tell))
    try:
        await asyncio.wait({job, playing}, return_when=asyncio.FIRST_COMPLETED)
        if playing.done():
            await playing
    finally:
        playing.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await playing
        serving.should_exit = True
        await job


def address_of(listening: socket.socket, server: StudyServer) -> str:
    """Return the page's address."""
    host, port = listening.getsockname()[:2]
    shown = f"[{host}]" if ":" in host else host
    return f"http://{shown}:{port}{server.path}"


def devices_here(plan: StudyPlan) -> list[str]:
    """Return the plan's devices that the page offers."""
    return [name for name in plan.devices if name not in NOT_OFFERED]

"""Carries out a study's sessions: the server of its page, its folder, and scripts in the place of people."""

import asyncio
import contextlib
import socket
from collections.abc import Callable
from pathlib import Path

from websockets.exceptions import ConnectionClosed

from handover.scenarios.live.page_server import PageServer, ended_by_signals
from handover.scenarios.live.webcam import WebcamFiles
from handover.scenarios.study.folder.session_folder import RoundRecord, pseudonym_of
from handover.scenarios.study.folder.study_folder import StudyFolder
from handover.scenarios.study.plan.led_hands import hand_faults
from handover.scenarios.study.plan.order import Round
from handover.scenarios.study.plan.plan import TRACKER, WEBCAM, StudyPlan
from handover.scenarios.study.session.pilot import PilotRefused, play_sessions
from handover.scenarios.study.session.protocol import Protocol
from handover.scenarios.study.session.seat import StudySeat
from handover.scenarios.study.session.server import StudyServer, listening_socket, page_server


class NotServed(RuntimeError):
    """A study that cannot be served as it was asked for."""


class PilotsBrokenOff(RuntimeError):
    """Scripted pilots that have not all taken part, since the server was lost or has refused one."""


async def serve_study(
    plan: StudyPlan,
    out: Path,
    *,
    host: str,
    port: int,
    number: int | None,
    pace: float,
    pilot: bool,
    webcam: WebcamFiles | None,
    photodiode: bool,
    tell: Callable[[str], None],
) -> None:
    """Serve a study's page until it is ended, or until all scripted pilots have taken part.

    Args:
        plan: the study's.
        out: its folder, new, or one that goes on.
        host: the address on which it listens.
        port: likewise; 0: any that is free.
        number: the first participant's; None: the next, or, where a session is not complete, whom the page names.
        pace: simulated seconds per second of wall time.
        pilot: whether scripts take part.
        webcam: files by which a webcam leads the hand; None where it is not offered.
        photodiode: see `study_html`.
        tell: is given lines for who carries it out.

    Raises:
        NotServed: the address cannot be used, the page offers none of the plan's devices, or nobody outside can lead
            the hand in a scenario.
        PilotsBrokenOff: scripted pilots did not get to their end.
        InvalidRunFolder, RecordNotWritten: see `StudyFolder.opened`.
    """
    if faults := hand_faults(plan):
        raise NotServed("; ".join(faults))
    devices = devices_here(plan, webcam)
    if not devices:
        raise NotServed("the plan has no device but a webcam, which needs --webcam FOLDER")
    try:
        listening = listening_socket(host, port)
    except OSError as e:
        raise NotServed(f"--host {host} --port {port}: it cannot listen there: {e.strerror or e}") from e
    with listening, (study := StudyFolder.opened(out, plan)).held():
        seat = StudySeat(Protocol(study, devices, number), pace, {} if webcam is None else webcam.hashes())
        server = StudyServer(seat, host, webcam, photodiode=photodiode)
        serving = page_server(server)
        seat.on_round_end = lambda planned, ended: tell(line_of_round(plan, seat.protocol.number, planned, ended))
        address = address_of(listening, server)
        with ended_by_signals(serving.end):  # before anybody reads that Ctrl-C ends it
            tell(f"study: {address}  (results in {out}; Ctrl-C ends it)")
            if TRACKER in plan.devices:
                tell(f"a hand tracker connects to {address.replace('http', 'ws', 1)}hand")
            if pilot:
                await _with_pilots(serving, server, listening, address, tell)
            else:
                await serving.serve(sockets=[listening])


async def _with_pilots(
    serving: PageServer, server: StudyServer, listening: socket.socket, address: str, tell: Callable[[str], None]
) -> None:
    job = asyncio.create_task(serving.serve(sockets=[listening]))
    playing = asyncio.create_task(play_sessions(address, server.seat.protocol.study.plan, tell))
    try:
        await asyncio.wait({job, playing}, return_when=asyncio.FIRST_COMPLETED)
        was_ended = serving.should_exit  # by Ctrl-C
        if playing.done():
            await _ended(playing, was_ended=was_ended)
        elif not was_ended:
            raise PilotsBrokenOff("the server has ended before all scripted pilots have taken part")
    finally:
        playing.cancel()
        with contextlib.suppress(asyncio.CancelledError, Exception):
            await playing
        serving.end()
        await job


async def _ended(playing: "asyncio.Task[None]", *, was_ended: bool) -> None:
    """Take the end of scripted pilots.

    Raises:
        PilotsBrokenOff: they did not get to theirs, and nobody has ended the server.
    """
    try:
        await playing
    except (ConnectionClosed, OSError, PilotRefused) as e:
        if not was_ended:
            raise PilotsBrokenOff(f"the scripted pilot was broken off: {e}") from e


def line_of_round(plan: StudyPlan, number: int, planned: Round, ended: RoundRecord | str) -> str:
    """Return what became of a round, for who carries the study out.

    Args:
        plan: the study's.
        number: the participant's.
        planned: the round.
        ended: its record; why it does not count, if it does not.
    """
    c = planned.condition
    which = f"{pseudonym_of(number)}, round {planned.number} ({c.task}, {c.behaviour})"
    if isinstance(ended, str):
        return f"{which} does not count: {ended}"
    line = f"{which}: {'succeeded' if ended.success else 'failed'}"
    if ended.latency_median_ms is None or ended.latency_p95_ms is None:
        return line
    line += f"; from the hand to the picture {ended.latency_median_ms:.0f} ms, at 95 % {ended.latency_p95_ms:.0f} ms"
    is_late = ended.latency_p95_ms > plan.latency_limit
    return line + (f", over the plan's {plan.latency_limit:g} ms: the round is marked" if is_late else "")


def address_of(listening: socket.socket, server: StudyServer) -> str:
    """Return the page's address; of a server that listens on all of them, that at which others reach it."""
    host, port = listening.getsockname()[:2]
    if host in ("0.0.0.0", "::"):
        host = _own_address(listening.family)
    shown = f"[{host}]" if ":" in host else host
    return f"http://{shown}:{port}{server.path}"


def _own_address(family: int) -> str:
    """Return this computer's address on its network, or its name if it is on none."""
    elsewhere = "2001:db8::1" if family == socket.AF_INET6 else "192.0.2.1"  # of documentation: nothing is sent there
    with contextlib.suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as probe:
        probe.connect((elsewhere, 9))
        return str(probe.getsockname()[0])
    return socket.gethostname()


def devices_here(plan: StudyPlan, webcam: WebcamFiles | None = None) -> list[str]:
    """Return the plan's devices that the page offers."""
    return [name for name in plan.devices if name != WEBCAM or webcam is not None]

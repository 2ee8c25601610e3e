"""The process that serves instances: what is left of one that has ended."""

import contextlib
import gc
import os
import socket
import weakref
import zipfile
from pathlib import Path

import pytest

from handover.fmus.build import cached
from handover.fmus.server import ANSWER, CALL, Channel, Server

pytestmark = pytest.mark.skipif(os.name == "nt", reason="the channel is a pipe there")


def test_nothing_is_left_of_an_instance_that_has_ended(tmp_path: Path):
    with zipfile.ZipFile(cached("Push", 3)) as archive:
        archive.extractall(tmp_path)
        token = archive.read("resources/unit.json").decode().partition('"token": "')[2].partition('"')[0]
    start = f"{token}\n{tmp_path / 'resources'}".encode()
    host, ours = socket.socketpair()
    host.sendall(CALL.pack(b"start", -1, len(start), True) + start)
    host.sendall(CALL.pack(b"initialise", -1, 0, False))
    host.shutdown(socket.SHUT_WR)
    memory = os.open(tmp_path / "memory", os.O_RDWR | os.O_CREAT)
    server = Server(Channel(ours.fileno()), memory)
    gc.collect()
    gc.disable()
    try:
        with contextlib.suppress(SystemExit):
            server.run()
        answers = host.recv(1 << 20)
        left = [weakref.ref(server), weakref.ref(server._memory)]  # pyright: ignore[reportPrivateUsage]
        del server
        assert [reference() for reference in left] == [None, None]
    finally:
        gc.enable()
        os.close(memory)
    assert ANSWER.unpack(answers[: ANSWER.size])[0] == 0, answers
    assert answers.endswith(ANSWER.pack(0, 0))

"""What a port's buffer holds, as bytes: to see whether it has changed."""

import ctypes

from handover.cosim.blocks.variable import Kind
from handover.cosim.fmu_description import FmuPort
from handover.cosim.signal_buffer import Views


def content_of(port: FmuPort, views: Views) -> bytes:
    """Return what a port holds; of strings and binaries the text and the bytes, not where they lie."""
    if port.kind is Kind.STRING:
        texts = (ctypes.string_at(int(a)) if a else b"" for a in views[0])
        return b"\0".join(texts)
    if port.kind is Kind.BINARY:
        pairs = zip(views[0], views[1], strict=True)
        return b"".join(int(n).to_bytes(8, "little") + ctypes.string_at(int(a), int(n)) for a, n in pairs)
    return views[0].tobytes()

"""Files by which a page finds a hand in a webcam's pictures: MediaPipe's tasks-vision and its model, given by the lab.

They are in one folder: the npm package `@mediapipe/tasks-vision`, unpacked, with the model `hand_landmarker.task`
beside its `vision_bundle.mjs`. Neither is part of this project: the package's WebAssembly has 13 MB, and the
model is another download. Just the files of `FILES` are served, as they were read at first; their hashes are kept
with the run.

The page's thread that uses them (`hand_worker.js`) has a policy by which it may compile them, and may connect to
nothing but this computer's server: what the package would report about its use to its makers is not sent.
"""

import hashlib
import io
import lzma
import zipfile
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from handover.cosim.files import read_regular
from handover.scenarios.runs.reporting.page import asset

WEBCAM_SCRIPTS = ("hand/hand_landmarks.js", "hand/hand_camera.js")
"""Scripts of a page that offers a webcam."""
BUNDLE, MODEL = "vision_bundle.mjs", "hand_landmarker.task"
LOADER, WASM = "wasm/vision_wasm_module_internal.js", "wasm/vision_wasm_module_internal.wasm"
MODEL_PARTS = ("hand_detector.tflite", "hand_landmarks_detector.tflite")
"""What a model of a hand holds, as a zip file."""
_LARGEST = 100_000_000
"""Bytes; the largest of the files has 13 million."""
_POLICY = "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; connect-src 'self'"
_DAMAGES = (
    *(zipfile.BadZipFile, zlib.error, lzma.LZMAError),
    *(NotImplementedError, RuntimeError, EOFError, OSError, ValueError),
)
"""What the reading of a damaged zip file raises: each of its compressions has its own."""
_TYPES = {".js": "text/javascript", ".mjs": "text/javascript", ".wasm": "application/wasm"}


class InvalidWebcamFiles(ValueError):
    """A folder has not what a webcam needs to lead a hand; the message tells all that is wrong."""


@dataclass(frozen=True)
class WebcamFiles:
    """These files, as they were read.

    Attributes:
        contents: by their paths in the folder.
    """

    contents: Mapping[str, bytes]

    @classmethod
    def read(cls, folder: Path) -> "WebcamFiles":
        """Read them from a folder.

        Raises:
            InvalidWebcamFiles: one is missing, cannot be read, or is not what its name says.
        """
        if not folder.is_dir():
            raise InvalidWebcamFiles(f"{folder} is not a folder; {_RIGHT}")
        contents, faults = dict[str, bytes](), list[str]()
        for name, fault_of in FILES.items():
            try:
                content = read_regular(folder / name, _LARGEST)
                fault = fault_of(content) if content else "is empty"
            except FileNotFoundError:
                content, fault = b"", "is missing"
            except OSError as e:
                content, fault = b"", f"cannot be read: {e.strerror}"
            contents[name] = content
            if fault:
                faults.append(f"{name} {fault}")
        if faults:
            raise InvalidWebcamFiles(f"in {folder}: {'; '.join(faults)}; {_RIGHT}")
        return cls(contents)

    def hashes(self) -> dict[str, str]:
        """Return the SHA-256 of each file, in hexadecimal digits."""
        return {name: hashlib.sha256(content).hexdigest() for name, content in self.contents.items()}

    def routes(self, below: str = "/") -> Sequence[Route]:
        """Return where they are served, with the program that uses them.

        Args:
            below: path of the page.
        """
        served = {Path(name).name: content for name, content in self.contents.items()}
        served["worker.js"] = asset("hand/hand_worker.js").encode()
        return [Route(f"{below}webcam/{name}", _served(name, content)) for name, content in served.items()]


def _served(name: str, content: bytes) -> Callable[[Request], Response]:
    headers = {
        "Content-Security-Policy": _POLICY,
        "X-Content-Type-Options": "nosniff",
        "Cross-Origin-Resource-Policy": "same-origin",
        "Cache-Control": "no-store",
    }
    media_type = _TYPES.get(Path(name).suffix, "application/octet-stream")

    def answer(_request: Request) -> Response:
        return Response(content, media_type=media_type, headers=headers)

    return answer


def _fault_of_bundle(content: bytes) -> str:
    if b"HandLandmarker" in content and b"export" in content:
        return ""
    return "is not a module that exports HandLandmarker"


def _fault_of_loader(content: bytes) -> str:
    return "" if b"ModuleFactory" in content else "does not load tasks-vision's WebAssembly: it names no ModuleFactory"


def _fault_of_wasm(content: bytes) -> str:
    return "" if content.startswith(b"\0asm") else "is not WebAssembly, which begins with \\0asm"


def _fault_of_model(content: bytes) -> str:
    """Return what is wrong with a model of a hand, a zip file of two TensorFlow Lite models."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as bundle:
            there = [part for part in bundle.infolist() if part.filename in MODEL_PARTS]
            if large := [part.filename for part in there if part.file_size > _LARGEST]:
                return f"has a part of more than {_LARGEST // 10**6} MB: {large[0]}"
            parts = {part.filename: bundle.read(part)[4:8] for part in there}
    except _DAMAGES as e:
        return f"is not a bundle of models, a zip file: {e}"
    wrong = [name for name in MODEL_PARTS if parts.get(name) != b"TFL3"]
    return f"has no TensorFlow Lite model {' and '.join(wrong)}" if wrong else ""


FILES: Mapping[str, Callable[[bytes], str]] = {
    BUNDLE: _fault_of_bundle,
    LOADER: _fault_of_loader,
    WASM: _fault_of_wasm,
    MODEL: _fault_of_model,
}
"""The files by their paths in the folder, and what is wrong with one, "" if nothing is."""
_RIGHT = (
    f"expected the unpacked npm package @mediapipe/tasks-vision, with {BUNDLE} and {LOADER},"
    f" and MediaPipe's model {MODEL} put into it"
)

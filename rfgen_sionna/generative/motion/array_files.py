"""Files of arrays (`.npy`, `.npz`, `.pkl`, `.pt`) of other programs, read without running code from them."""

from __future__ import annotations

import io
import pickle
import zlib
from pathlib import Path
from typing import Any, ClassVar
from zipfile import BadZipFile, is_zipfile

import numpy as np

from rfgen_sionna.generative.motion.clip_error import ClipError

ARRAY_SUFFIXES = (".npy", ".npz", ".pkl", ".pickle", ".pt", ".pth")
_ALLOWED = {
    *((f"numpy.{core}.multiarray", name) for core in ("core", "_core") for name in ("_reconstruct", "scalar")),
    *((f"numpy.{core}.numeric", "_frombuffer") for core in ("core", "_core")),
    *(("numpy", name) for name in ("ndarray", "dtype")),
    *(("builtins", name) for name in ("list", "dict", "set", "tuple", "int", "float", "str", "bool", "bytes")),
    *(("collections", name) for name in ("OrderedDict", "defaultdict")),
    ("_codecs", "encode"),
}
"""What plain containers, numbers and NumPy's arrays are made of in pickles."""


class _JoblibArray:
    """Description of an array whose bytes follow in a file of joblib."""

    shape: tuple[int, ...] = ()
    dtype: np.dtype[Any] = np.dtype(float)
    order = "C"
    numpy_array_alignment_bytes: int | None = None

    def read(self, stream: io.BytesIO) -> np.ndarray:
        if self.dtype.hasobject:
            raise ClipError("an array of objects in joblib's format is refused; save it with np.savez")
        if self.numpy_array_alignment_bytes is not None:
            stream.read(stream.read(1)[0])
        count = int(np.prod(self.shape, dtype=np.int64))
        flat = np.frombuffer(stream.read(count * self.dtype.itemsize), self.dtype)
        return flat.reshape(self.shape[::-1]).T if self.order == "F" else flat.reshape(self.shape)


class _ArraysOnly(pickle._Unpickler):
    """Unpickler of plain containers and arrays, also in joblib's format; refuses everything executable."""

    stack: list[Any]
    dispatch: ClassVar[dict[int, Any]] = dict(pickle._Unpickler.dispatch)

    def __init__(self, stream: io.BytesIO) -> None:
        super().__init__(stream, encoding="latin1")
        self.stream = stream

    def find_class(self, module: str, name: str) -> Any:
        module = module.replace("__builtin__", "builtins")  # of Python 2
        if (module, name) == ("joblib.numpy_pickle", "NumpyArrayWrapper"):
            return _JoblibArray
        if (module, name) == ("torch.storage", "_load_from_bytes"):
            return _load_storage
        if (module, name) == ("torch._utils", "_rebuild_tensor_v2"):
            return super().find_class(module, name)
        if (module, name) not in _ALLOWED:
            raise ClipError(f"the file loads {module}.{name}; only arrays, texts and numbers are allowed")
        return super().find_class(module, name)

    def load_build(self) -> None:
        build: Any = pickle._Unpickler.dispatch[pickle.BUILD[0]]
        build(self)
        if isinstance(self.stack[-1], _JoblibArray):
            self.stack.append(self.stack.pop().read(self.stream))

    dispatch[pickle.BUILD[0]] = load_build


def _load_storage(raw: bytes) -> Any:
    """Numbers of a tensor within a pickle, by torch's safe reader."""
    import torch

    return torch.load(io.BytesIO(raw), map_location="cpu", weights_only=True)


def read_arrays(path: Path) -> Any:
    """Content of a file of arrays: an array, or dictionaries and lists of arrays, texts and numbers.

    Raises:
        FileNotFoundError: there is no such file.
        ClipError: the file is not readable, or holds objects that would run code.
    """
    if not path.is_file():
        raise FileNotFoundError(f"no motion file {path}")
    kind = path.suffix.lower()
    if kind == ".npz":
        return _read_npz(path)
    if kind in (".pt", ".pth"):
        return _read_tensors(path)
    raw = path.read_bytes()
    if kind == ".npy":
        return _read_npy(path.name, raw)
    if raw[:1] == b"x" or raw[:2] == b"\x1f\x8b":
        raw = _inflated(path.name, raw)
    return _unpickled(path.name, io.BytesIO(raw))


def _inflated(name: str, raw: bytes) -> bytes:
    try:
        return zlib.decompress(raw, wbits=47)  # zlib and gzip
    except zlib.error as error:
        raise ClipError(f"{name}: compressed, and not readable ({error})") from error


def _unpickled(name: str, stream: io.BytesIO) -> Any:
    try:
        boxed = _ArraysOnly(stream).load()
    except ClipError as error:
        raise ClipError(f"{name}: {error}") from error
    except ImportError as error:
        raise ImportError(f"{name}: holds tensors, which need torch (pip install torch)") from error
    except Exception as error:  # a broken pickle raises errors of many kinds
        raise ClipError(f"{name}: not a readable file of arrays ({type(error).__name__}: {error})") from error
    boxed = boxed.item() if isinstance(boxed, np.ndarray) and boxed.shape == () else boxed
    return _numpy(boxed)


def _read_npy(name: str, raw: bytes) -> Any:
    try:
        return np.load(io.BytesIO(raw), allow_pickle=False)
    except ValueError as error:
        if "allow_pickle" not in str(error):
            raise ClipError(f"{name}: not a readable .npy file ({error})") from error
    except (EOFError, OSError) as error:
        raise ClipError(f"{name}: not a readable .npy file ({error})") from error
    if not raw.startswith(np.lib.format.MAGIC_PREFIX):
        raise ClipError(f"{name}: not a readable .npy file")
    stream = io.BytesIO(raw)
    try:
        version = np.lib.format.read_magic(stream)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        read(stream)
    except ValueError as error:
        raise ClipError(f"{name}: not a readable .npy file ({error})") from error
    return _unpickled(name, stream)


def _read_objects(key: str, raw: bytes) -> Any:
    """Objects under a key of an archive; those that would run code, which a clip may not need, become the refusal."""
    try:
        return _read_npy(key, raw)
    except ClipError as error:
        return str(error)


def _read_npz(path: Path) -> dict[str, Any]:
    if not is_zipfile(path):
        raise ClipError(f"{path.name}: not a readable .npz file")
    found: dict[str, Any] = {}
    try:
        with np.load(path, allow_pickle=False) as file:
            for key in file.files:
                try:
                    found[key] = file[key]
                except ValueError as error:
                    if "allow_pickle" not in str(error):
                        raise
                    found[key] = _read_objects(key, file.zip.read(f"{key}.npy"))
    except (OSError, ValueError, KeyError, BadZipFile, zlib.error) as error:
        raise ClipError(f"{path.name}: not a readable .npz file ({error})") from error
    return found


def _read_tensors(path: Path) -> Any:
    try:
        import torch
    except ImportError as error:
        raise ImportError(
            f"{path.name}: files of torch.save need torch (pip install torch), or save NumPy arrays as .npz"
        ) from error
    try:
        loaded = torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:  # of many kinds, some with advice to run the file's code
        raise ClipError(
            f"{path.name}: torch's safe reader (weights_only=True) refuses it ({type(error).__name__}): it holds "
            "more than tensors, containers and numbers, or is no file of torch.save; save NumPy arrays as .npz"
        ) from error
    return _numpy(loaded)


def _numpy(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _numpy(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_numpy(item) for item in value]
    return value.detach().cpu().numpy() if hasattr(value, "detach") else value

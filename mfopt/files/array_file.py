"""Named arrays as bytes: an HDF5 file, or text that a line of the journal can hold."""

import base64
import hashlib
import io
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import quote, unquote

import h5py
import numpy as np

from mfopt.arrays import AnyArray
from mfopt.errors import ConfigError
from mfopt.files.whole import disk_errors_named, write_aside

COMPRESSED = 1000  # values of an array that is worth compressing


def write_arrays(path: Path, arrays: Mapping[str, AnyArray]) -> str:
    """Write named arrays of numbers to an HDF5 file that is either whole or absent.

    Returns:
        The digest of the file.

    Raises:
        ConfigError: if the disk refuses it.
    """
    content = io.BytesIO()  # HDF5 cannot close a file on a full disk
    with h5py.File(content, "w") as file:
        for name, values in arrays.items():
            array = np.asarray(values)
            packed = {"compression": "gzip"} if array.size > COMPRESSED else {}
            file.create_dataset(_quoted(name), data=array, **packed)
    write_aside(path, content.getvalue())
    return digest(content.getvalue())


def read_arrays(path: Path, expected: str | None = None) -> dict[str, AnyArray]:
    """Read every array of an HDF5 file.

    Args:
        expected: digest of the file as it was written, if that is known.

    Raises:
        ConfigError: if the file is missing or damaged.
    """
    with disk_errors_named(path, "read"):
        content = path.read_bytes()  # and not by HDF5, whose locks some file systems refuse
    if expected is not None and digest(content) != expected:
        raise ConfigError(f"{path} is damaged: it is not what was written")
    try:
        with h5py.File(io.BytesIO(content), "r") as file:
            return {_unquoted(name): np.asarray(dataset) for name, dataset in file.items()}
    except Exception as error:  # HDF5 raises many kinds on damage
        raise ConfigError(f"{path} is damaged; restore it: {error}") from error


def digest(content: bytes) -> str:
    """Digest of a file or a line, by which a change is noticed."""
    return hashlib.sha256(content).hexdigest()[:32]


def fit_hdf5(array: AnyArray) -> bool:
    """Whether HDF5 gives the array back as it is."""
    return array.dtype.kind in "biufc" and array.dtype.char not in "gG"  # padded to 16 bytes


def as_text(array: AnyArray) -> str:
    """An array as text, bit for bit and with its type.

    Raises:
        ValueError: if it holds Python objects.
    """
    content = io.BytesIO()
    np.lib.format.write_array(content, np.asarray(array), allow_pickle=False)
    return base64.b64encode(content.getvalue()).decode("ascii")


def from_text(text: str) -> AnyArray:
    """The array that `as_text` wrote.

    Raises:
        ValueError: if the text is damaged.
    """
    content = io.BytesIO(base64.b64decode(text, validate=True))
    array: AnyArray = np.lib.format.read_array(content, allow_pickle=False)
    return array


def _quoted(name: str) -> str:
    """A name that HDF5 does not take for a path."""
    return {"": "%", ".": "%2E"}.get(name) or quote(name, safe=" ", errors="surrogatepass")


def _unquoted(name: str) -> str:
    return "" if name == "%" else unquote(name, errors="surrogatepass")

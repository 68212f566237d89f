"""Store arrays as HDF5 does, in chunks: bytes shuffled, deflated, checksummed.

HDF5 deflates every byte alike. The last digits of a measured number are noise, which no compression shortens: shuffled, they
lie together, and here they are stored as they are. What deflate is still asked to do takes a third of the time, and every
reader of HDF5 unpacks the chunk as any other: its data are a zlib stream (RFC 1950) of deflated and stored blocks (RFC 1951).
"""

from __future__ import annotations

import struct
import zlib
from itertools import groupby, product
from typing import Any

import numpy as np
import numpy.typing as npt

from pipelines.io.experiment import Array

__all__ = ["packed", "store"]

_LEVEL = 1  # of deflate
_SAMPLED = 2048  # bytes of a plane that are counted
_NOISE = 1.15 / 256.0  # two bytes of noise are the same in one of 256 cases; up to this, deflate gains less than 3 %
_FEW = 4096  # bytes of a plane that are soon deflated
_BLOCK = 65535  # [B] of a stored block at most

Bytes = npt.NDArray[np.uint8]


def store(group: Any, name: str, values: Array, chunk: tuple[int, ...]) -> Any:
    """Write `values` as the data set `name` of `group`, in chunks of shape `chunk` with gzip, shuffle and fletcher32."""
    dataset = group.create_dataset(name, shape=values.shape, dtype="<f8", chunks=chunk, compression="gzip",
                                   compression_opts=_LEVEL, shuffle=True, fletcher32=True, track_times=False)
    for corner in product(*(range(0, size, step) for size, step in zip(values.shape, chunk, strict=True))):
        piece = values[tuple(slice(k, k + step) for k, step in zip(corner, chunk, strict=True))]
        if piece.shape != chunk:  # one at the edge is as large as the others
            piece = np.pad(piece, [(0, step - size) for size, step in zip(piece.shape, chunk, strict=True)])
        dataset.id.write_direct_chunk(corner, packed(piece))
    return dataset


def packed(values: Array) -> bytes:
    """The chunk of `values` after the filters shuffle, deflate and fletcher32."""
    planes = np.ascontiguousarray(np.ascontiguousarray(values, dtype="<f8").reshape(-1, 1).view(np.uint8).T)
    stream = _deflated(planes)
    return stream + struct.pack("<I", fletcher32(stream))


def _deflated(planes: Bytes) -> bytes:
    """Planes (8, samples) one behind the other as a zlib stream."""
    parts = [b"\x78\x01"]
    for noisy, group in groupby(zip(_noise(planes), planes, strict=True), key=lambda pair: pair[0]):
        data = b"".join(plane.tobytes() for _, plane in group)
        if noisy:
            parts += (_stored(data[k:k + _BLOCK]) for k in range(0, len(data), _BLOCK))
        else:
            squeeze = zlib.compressobj(_LEVEL, wbits=-zlib.MAX_WBITS)
            parts += (squeeze.compress(data), squeeze.flush(zlib.Z_FULL_FLUSH))
    return b"".join((*parts, b"\x01\x00\x00\xff\xff", struct.pack(">I", zlib.adler32(planes.data))))


def _stored(data: bytes) -> bytes:
    """RFC 1951, section 3.2.4."""
    return struct.pack("<BHH", 0, len(data), len(data) ^ 0xFFFF) + data


def _noise(planes: Bytes) -> list[bool]:
    """Which planes are noise: two of their bytes, drawn at random, are hardly ever the same, and nothing comes twice."""
    if planes.shape[1] < _FEW:
        return [False] * 8
    some = planes[:, ::max(1, planes.shape[1] // _SAMPLED)][:, :_SAMPLED]
    count = some.shape[1]
    table = np.bincount((some + 256 * np.arange(8)[:, None]).ravel(), minlength=8 * 256).reshape(8, 256)
    alike = np.einsum("pk,pk->p", table, table) - count
    even = alike < _NOISE * count * (count - 1)
    return [bool(flat) and not _repeats(plane) for flat, plane in zip(even, planes, strict=True)]


def _repeats(plane: Bytes) -> bool:
    """Return whether the four bytes behind some byte are those behind its like elsewhere, as in a clock or a periodic reference."""
    at = np.flatnonzero(plane[:-4] == plane[len(plane) // 2])
    behind = plane[at[:, None] + np.arange(1, 5)].view("<u4").ravel().tolist()
    return len(set(behind)) < len(behind)


def fletcher32(data: bytes) -> int:
    """The checksum that HDF5 puts behind a chunk. Fletcher 1982, IEEE Trans. Commun. 30, p. 247, over 16-bit words."""
    words = np.frombuffer(data + b"\0" * (len(data) % 2), dtype=">u2").astype(np.int64)
    sums = int(words.sum()), int(words @ np.arange(len(words), 0, -1))
    low, high = (total and (total - 1) % 65535 + 1 for total in sums)  # as adding the carry leaves it: zero only of zeros
    return high << 16 | low

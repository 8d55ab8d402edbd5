"""What a MATLAB file unpacks to, from its headers alone.

Source: MathWorks, MAT-File Format, level 5: after 128 bytes, elements of a kind and a length in
bytes; those of kind 15 are packed by zlib and hold one element.
"""

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

HEADER, PACKED = 128, 15


def mat_sizes(path: Path) -> tuple[int, int]:
    """Bytes of the arrays as numbers, and of the elements as they are stored.

    Raises what `scipy.io.whosmat` raises for another file.
    """
    import scipy.io

    shapes = [shape for _, shape, _ in scipy.io.whosmat(path)]
    return 8 * sum(int(np.prod(shape, dtype=object)) for shape in shapes), sum(_elements(path))


def _elements(path: Path) -> Iterator[int]:
    """Bytes of each element, unpacked; nothing of a file of level 4, which packs nothing."""
    with path.open("rb") as file:
        head = file.read(HEADER)
        order = {b"IM": "<", b"MI": ">"}.get(head[126:128])
        while order is not None and len(tag := file.read(8)) == 8:
            kind, size = struct.unpack(f"{order}II", tag)
            after, inner = file.tell() + size, b""
            if kind == PACKED:
                inner = zlib.decompressobj().decompress(file.read(min(size, 4096)), 8)
            yield struct.unpack(f"{order}II", inner)[1] if len(inner) == 8 else size
            file.seek(after)

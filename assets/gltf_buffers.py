"""Files that a glTF file may refer to."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from trimesh.resolvers import FilePathResolver

_LARGEST_BYTES = 256 << 20


def referenced_buffers(file: Path) -> FilePathResolver:
    """A resolver that opens the `.bin` buffers of a `.gltf` file in its folder, of bounded size; no textures."""
    from trimesh.resolvers import FilePathResolver  # slow to import

    class BuffersOnly(FilePathResolver):
        def get(self, name: str) -> bytes:
            path = self.absolute(name)
            if not path.resolve().is_relative_to(file.parent.resolve()):
                raise OSError(f"{name} leads out of the file's folder")
            if path.suffix.lower() != ".bin" or path.stat().st_size > _LARGEST_BYTES:
                raise OSError(f"{name} is not a .bin file of at most {_LARGEST_BYTES >> 20} MiB")
            return path.read_bytes()

    return BuffersOnly(str(file))

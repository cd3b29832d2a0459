"""Write the drives of variants; files that are equal in the source are hard links to it."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import os
import shutil
from collections.abc import Mapping
from pathlib import Path

from cosim.drives.writer import MANIFEST, DriveWriter, explained, partial_of, sha256_of
from cosim.variants.maker import VariantFrame

_NOT_LINKABLE = (errno.EXDEV, errno.EPERM, errno.EMLINK, errno.ENOTSUP)


class VariantWriter(DriveWriter):
    """Writer of one variant's drive; several processes may write frames of it at the same time."""

    def share(self, name: str, source: Path) -> None:
        """Create a hard link to a file of the source, or a copy if the file system does not support links.

        Raises:
            OutputError: neither is possible.
        """
        path = self.folder / name
        partial = partial_of(path)
        with explained(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            if path.exists() and path.samefile(source):
                return
            partial.unlink(missing_ok=True)
            try:
                try:
                    os.link(source, partial)
                except OSError as error:
                    if error.errno not in _NOT_LINKABLE:
                        raise
                    shutil.copyfile(source, partial)
                partial.rename(path)
            except OSError:
                with contextlib.suppress(OSError):
                    partial.unlink(missing_ok=True)
                raise

    def write_variant(
        self, name: str, frame: VariantFrame, linked: Mapping[str, Path], expected_sha256: Mapping[str, str]
    ) -> None:
        """Write all files of a frame, then add it to the manifest.

        Args:
            name: name of the frame.
            frame: new files of the frame.
            linked: files shared with the source, by path.
            expected_sha256: known checksums of shared files, by path.
        """
        checksums = {path: hashlib.sha256(data).hexdigest() for path, data in frame.files.items()}
        for path, data in frame.files.items():
            self.write(path, data)
        for path, source in linked.items():
            self.share(path, source)
            checksums[path] = expected_sha256.get(path) or sha256_of(source)
        entry = {"name": name, "counts": frame.counts, "files": list(checksums), "sha256": list(checksums.values())}
        self._append_to(self.folder / MANIFEST, json.dumps(entry, separators=(",", ":")) + "\n")

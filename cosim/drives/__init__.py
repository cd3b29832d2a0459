"""A drive's files: written, locked, checked and read; KITTI's formats and the twin."""

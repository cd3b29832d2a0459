"""KITTI's file formats, read and written, and `Drive`, which reads a folder of frames."""

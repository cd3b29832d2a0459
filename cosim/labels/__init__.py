"""KITTI labels of what stands in a frame."""

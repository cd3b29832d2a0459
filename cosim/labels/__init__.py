"""KITTI labels of the objects in a frame."""

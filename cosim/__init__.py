"""The co-simulation: traffic, bridge, episodes, labels, KITTI files and the command line."""

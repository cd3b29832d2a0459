"""Where a run takes place, and with which meshes."""

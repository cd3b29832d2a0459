"""The ground: its plan in triangles, its heights, and thin sheets upon it."""

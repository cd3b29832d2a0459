"""Choice of the surface that returns a beam."""

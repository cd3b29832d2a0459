"""What may be missing, as columns that a residual is held against."""

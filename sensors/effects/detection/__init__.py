"""Detection of echoes."""

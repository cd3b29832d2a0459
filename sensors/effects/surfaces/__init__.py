"""Which surface answers a beam."""

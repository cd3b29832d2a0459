"""Whether an echo is noticed."""

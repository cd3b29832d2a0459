"""Pages about comparisons and diagnoses, each one self-contained HTML file."""

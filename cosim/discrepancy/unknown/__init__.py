"""What no effect of the catalogue explains: on what it depends, in what shape, and as an effect that runs."""

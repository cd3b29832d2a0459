"""What a sensor model lets expect of every beam."""

"""Sites of a run: static worlds, ground surface, and posed models of road users."""

"""Recording of simulated drives: configuration, episode plan, episodes and frame recorder."""

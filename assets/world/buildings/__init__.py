"""Buildings: plots, designed houses and their façades, and the buildings that a scenario defines."""

"""How much light comes back, and what intensity is made of it."""

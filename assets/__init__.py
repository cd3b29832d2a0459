"""What things look like: materials, parametric models, the static world."""

"""The static world of a town: ground, streets, buildings, plants and furniture."""

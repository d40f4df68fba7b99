"""A small robot with two driven wheels that carries things through a hall: world, planner, drive and battery."""

"""PX4: what its logs say, how its flights are found, and its health checks."""

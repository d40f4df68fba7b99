"""ArduPilot: what its logs say, the model of a flight or drive, health checks and measures of it."""

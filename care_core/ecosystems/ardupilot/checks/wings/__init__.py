"""Health checks of what only planes and QuadPlanes have: surfaces, an airspeed sensor, a propeller that pulls."""

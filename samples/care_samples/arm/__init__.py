"""A lander's arm that looks for the surface and digs: arm, soil, and the autonomy that commands guarded moves."""

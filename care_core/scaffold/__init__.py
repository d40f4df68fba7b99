"""A first profile for a robot that none is known of: what its logs set, measure and could be judged by."""

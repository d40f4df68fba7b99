"""What profiles measure of PX4 flights."""

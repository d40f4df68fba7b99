"""Many robots and runs at once: where their logs lie, one row a log, what the rows share, what would help most."""

"""Tables of runs: many logs read into rows, one a mission."""

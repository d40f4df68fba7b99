"""Simulated robots to try the program on: each runs a mission with the parameters it is given and writes a real log."""

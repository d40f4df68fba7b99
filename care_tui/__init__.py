"""The command line and the terminal app."""

__version__ = "0.1.0"

"""Readers of robot logs: `opening` picks one by what a file holds, `base` says what each offers."""

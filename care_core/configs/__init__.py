"""Configurations: files of each ecosystem, what was driven, and how two of them differ."""

"""What is known of parameters without any log: type, default, range, values, unit, restart, each with its source.

A table an ecosystem, as data beside the module that reads it. Knows no file and no log.
"""

"""What happened, for any log: its account in order of time, and findings, the first cause before its consequences.

Needs no profile. Reads logs and nothing else of the core.
"""

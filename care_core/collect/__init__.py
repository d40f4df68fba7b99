"""Campaigns: configurations are chosen, the operator's command runs each, and its logs become a table of runs."""

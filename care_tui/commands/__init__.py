"""The commands, one module a subject; `care_tui.cli` puts them together."""

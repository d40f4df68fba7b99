"""The command line and the terminal app."""

from care_tui.import_path import leave_current_folder

__version__ = "0.1.0"

leave_current_folder()  # before anything else is imported

"""`python -m care_tui`, for where the command `care` is not on the path."""

from care_tui.cli import main

if __name__ == "__main__":
    main()

"""`python -m care_tui`, for where the command `care` is not on the path."""

from care_tui.start import main

if __name__ == "__main__":
    main()

"""Where this program imports from, and where helper programs are found: not in the folder it is called in, which may
hold a stranger's files.

Python looks there first when it is started with `-m` or `-c`, and where PYTHONPATH has an empty or a relative part (a
`:` too many is enough). So does whoever starts a program by its name where PATH has one, and libraries do: the first
import of a plotting library asks `fc-list` for the fonts. Nothing is imported here but what every interpreter has
loaded already.
"""

from __future__ import annotations

import os
import sys


def leave_current_folder() -> None:
    """Take that folder out of PATH, and out of `sys.path` unless this program itself lies in it."""
    if "PATH" in os.environ:
        folders = os.environ["PATH"].split(os.pathsep)
        os.environ["PATH"] = os.pathsep.join(filter(os.path.isabs, folders))
    try:
        here = os.getcwd()
    except OSError:  # it was deleted: nothing is found in it
        return
    if here == os.path.dirname(os.path.dirname(os.path.realpath(__file__))):
        return
    if sys.argv[:1] in (["-m"], ["-c"]) and sys.path[:1] in ([""], [here]):
        del sys.path[0]
    named = os.environ.get("PYTHONPATH")
    if named and not sys.flags.ignore_environment:
        places = named.split(os.pathsep)
        relative = {os.path.abspath(place) for place in places if not os.path.isabs(place)} - {*places}
        sys.path[:] = [place for place in sys.path if place not in relative]

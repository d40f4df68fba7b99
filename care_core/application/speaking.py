"""Errors as they are told in Python: of arguments, where the command line speaks of its options.

What is wrong is found in one place and said once; only how an operator gives something differs by where he gives it.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from care_core.errors import CareError

Arguments = ParamSpec("Arguments")
Answer = TypeVar("Answer")

_OPTIONS = tuple(
    (re.compile(option), argument)
    for option, argument in (
        (r"(?:give|with|write|Write) --threshold (\S+?)=([\w.+-]+)", r"pass thresholds={'\1': \2}"),
        (r"--threshold\b", "thresholds"),
        (r"--config (?:NAMESPACE=)?FILE\b", "configs=('FILE',)"),
        (r"--config NAMESPACE=(\S+)", r"configs=('NAMESPACE=\1',)"),
        (r"--config\b", "configs"),
        (r"--mission (\w+)", r"mission=\1"),
        (r"--profile FOLDER\b", "profile='FOLDER'"),
        (r"--set\b", "changes"),
        (r"--(keep|mission|profile|site|reference|since|robot|alternative)\b", r"\1"),
    )
)
"""What an option of the command line is in Python; the first that fits."""


def in_python(text: str) -> str:
    """A sentence with arguments in place of options."""
    for option, argument in _OPTIONS:
        text = option.sub(argument, text)
    return text


def speaking_python(function: Callable[Arguments, Answer]) -> Callable[Arguments, Answer]:
    """The function, whose errors speak of arguments."""

    @wraps(function)
    def called(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Answer:
        try:
            return function(*args, **kwargs)
        except CareError as err:
            err.message, err.hint, err.where = map(in_python, (err.message, err.hint, err.where))
            raise

    return called

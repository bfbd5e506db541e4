"""Functions whose first argument, a folder or a file, is given later: builders of trial inputs and of their damage."""

from collections.abc import Callable
from functools import wraps
from typing import Any


def builder(write: Callable[..., Any]) -> Callable[..., Callable[[Any], Any]]:
    """The function with its first argument left to a second call: `write(place, *words)` as `write(*words)(place)`."""

    @wraps(write)
    def of(*words: Any, **how: Any) -> Callable[[Any], Any]:
        return lambda place: write(place, *words, **how)

    return of

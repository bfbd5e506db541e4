"""One evaluation of a run at a time, in a folder without the leftovers of a killed one."""

import contextlib
from collections.abc import Iterator

from endotsr.errors import InputError
from endotsr.training.runs.folder import RunFolder


@contextlib.contextmanager
def evaluating(folder: RunFolder, *, wait: bool = False) -> Iterator[None]:
    """Hold the lock of the evaluation for the block, as `RunFolder.evaluating`; leftovers are removed and named."""
    with folder.evaluating(wait=wait):
        with contextlib.suppress(InputError), folder.locked():  # a training that runs writes temporary files, too
            for line in folder.remove_leftovers():
                print(line, flush=True)
        yield

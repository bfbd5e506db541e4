"""Helpers of the tests folder and programs of the repository made importable; profiles of the property tests.

quick   the default: a few examples, new ones every run
ci      where CI is set: the same examples every run, and a blob that repeats a failure
deep    many examples: HYPOTHESIS_PROFILE=deep pytest tests/properties, or --hypothesis-profile=deep
"""

import os
import sys
from pathlib import Path

from hypothesis import HealthCheck, settings

from endotsr.cli.main import BLAS

os.environ.setdefault(*BLAS)  # as the command does: threads of BLAS beside other workers wait actively for one another

HERE = Path(__file__).parent
# Helpers of these folders are used in other folders too.
FOLDERS = ("clips", "clips/sequences/inputs", "method/splatting")
sys.path[:0] = [str(HERE), *(str(HERE / name) for name in FOLDERS)]
sys.path += [str(HERE.parent / name) for name in ("golden", "docs", "notebooks")]  # not installed

# No deadline: the first call of a kernel compiles it. Fixtures hold nothing that an example changes.
COMMON = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("quick", max_examples=15, **COMMON)
settings.register_profile("ci", max_examples=25, derandomize=True, print_blob=True, database=None, **COMMON)
settings.register_profile("deep", max_examples=1000, print_blob=True, **COMMON)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci" if os.environ.get("CI") else "quick"))

LARGEST_CREW = 8  # workers; each takes about a gigabyte


def pytest_xdist_auto_num_workers(config):
    """Workers of `-n auto`: one a core for folders of tests, none for files and tests that are named one by one."""
    if all(Path(word.partition("::")[0]).suffix == ".py" for word in config.args):
        return 0
    from endotsr.method.kernels.machine import usable_cores

    cores = usable_cores()
    return min(cores, LARGEST_CREW) if cores > 1 else 0


def pytest_xdist_setupnodes(config):
    """Before the workers of a whole run start: compile the kernels of a training once, which each would compile."""
    if config.args == config.getini("testpaths") and not config.option.keyword:
        from endotsr.config import config_from_dict
        from endotsr.training.fitting.compile_ahead import compile_ahead

        for precision in ("float32", "float64"):
            compile_ahead(config_from_dict({"training": {"precision": precision}}))


WORD = "gradcheck"


def pytest_ignore_collect(collection_path, config):
    """`-k` with this word imports the one file that it selects: to import all others takes longer than its tests."""
    other = collection_path.name.startswith("test_") and collection_path.name != f"test_{WORD}.py"
    return True if config.option.keyword == WORD and collection_path.is_file() and other else None

"""The public gradient checker, and every variant of every operation as a forward/reverse pair.

One call checks a port: `check_function(forward, reverse, inputs)` returns a `PairReport`.
"""

from endotsr.port.gradcheck.checker import DOUBLE, SINGLE, PairReport, Settings, check_function, check_pair
from endotsr.port.gradcheck.precision import PrecisionReport, check_precision
from endotsr.port.gradcheck.registry import Pair, all_pairs, definition_pairs, one_thread, pair_of, pair_stream
from endotsr.port.gradcheck.report import summary, table, to_json

__all__ = [
    "DOUBLE",
    "SINGLE",
    "Pair",
    "PairReport",
    "PrecisionReport",
    "Settings",
    "all_pairs",
    "check_function",
    "check_pair",
    "check_precision",
    "definition_pairs",
    "one_thread",
    "pair_of",
    "pair_stream",
    "summary",
    "table",
    "to_json",
]

"""Take the finite differences of every pair with compiled kernels: python tests/mutation/recording.py FILE"""

import pickle
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from endotsr.port.gradcheck import all_pairs, one_thread
from mutation.gradients import record

if __name__ == "__main__":
    with one_thread():
        found = {name: record(pair) for name, pair in all_pairs().items()}
    Path(sys.argv[1]).write_bytes(pickle.dumps(found))

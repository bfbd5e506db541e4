"""Survivors of the golden cases that another request tells from the right port.

    python tests/port/mutants/gaps.py definition|by_hand SURVEY.json [--out FILE.json]
"""

import argparse
import json
import resource
import signal
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[1]), str(Path(__file__).parents[2])]
from mutants import fuzz, ports
from mutants.kinds import wrong_versions
from mutants.survey import LIMIT, TooLong, _stop, passes, prepared

from endotsr.port.judge.store import golden_folder, read_golden
from mutation.mutator import in_place


def requests_of(port, golden):
    """Requests of every operation, the quickest first, each answered by the right port twice alike."""
    asked, found = prepared(port, golden), []
    files = {f.__code__: f"{s.name}.{n}" for s in port.sources for n, f in s.functions.items()}
    for one in asked:
        cases = [other.case for other in asked if other.case.operation == one.case.operation]
        count = 4 if one.seconds > 0.02 else fuzz.PER_CASE
        for number in range(count):
            inputs, settings = fuzz.drawn(one.case, one.inputs, cases, number)
            ran = set()

            def watch(frame, event, _):
                if event == "call" and frame.f_code in files:
                    ran.add(files[frame.f_code])

            signal.setitimer(signal.ITIMER_REAL, LIMIT)
            try:
                with np.errstate(all="ignore"):
                    sys.setprofile(watch)
                    right = port.answer(one.case.operation, inputs, settings)
                    sys.setprofile(None)
                    shaken = {k: v * (1 + 1e-15) if v.dtype.kind == "f" else v for k, v in inputs.items()}
                    other = port.answer(one.case.operation, shaken, settings)
            except Exception:
                continue
            finally:
                sys.setprofile(None)
                signal.setitimer(signal.ITIMER_REAL, 0)
            right = {n: np.asarray(v) for n, v in right.items() if n in one.case.outputs}
            good = {n: v for n, v in right.items() if v.dtype.kind != "f" or np.isfinite(v).all()}
            good = {n: v for n, v in good.items() if not fuzz.apart({n: other[n]}, {n: v})}
            if good:
                found.append(fuzz.Request(one.case.operation, inputs, settings, good, frozenset(ran)))
    return found


def main(words):
    parser = argparse.ArgumentParser()
    parser.add_argument("port")
    parser.add_argument("survey", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--golden", type=Path, default=golden_folder())
    options = parser.parse_args(words)
    signal.signal(signal.SIGALRM, _stop)
    resource.setrlimit(resource.RLIMIT_AS, (6 << 30, 6 << 30))
    port, golden = getattr(ports, options.port)(), read_golden(options.golden, verify=False)
    began = time.monotonic()
    requests = requests_of(port, golden)
    print(len(requests), "requests", f"{time.monotonic() - began:.0f} s", file=sys.stderr)
    survivors = {n for n, (_, r, _) in json.loads(options.survey.read_text()).items() if r == "passed"}
    gaps, same = {}, []
    kills = Counter()
    for source in port.sources:
        for function, mutant in wrong_versions(source):
            if mutant.name not in survivors:
                continue
            told = ""
            some = [k for k, r in enumerate(requests) if mutant.kernel in r.functions]
            some.sort(key=lambda k: -kills[mutant.kernel, k])
            with in_place(function, mutant.code), np.errstate(all="ignore"):
                for k in some:
                    r = requests[k]
                    signal.setitimer(signal.ITIMER_REAL, LIMIT)
                    try:
                        got = port.answer(r.operation, r.inputs, r.settings)
                        differs = fuzz.apart(got, r.right)
                    except Exception:
                        differs = True
                    finally:
                        signal.setitimer(signal.ITIMER_REAL, 0)
                    if differs:
                        told = r.operation
                        kills[mutant.kernel, k] += 1
                        break
            if told:
                gaps[mutant.name] = [mutant.kind, told]
            else:
                same.append(mutant.name)
    print(len(survivors), "survivors", len(gaps), "gaps", len(same), "same", f"{time.monotonic() - began:.0f} s")
    if options.out:
        options.out.write_text(json.dumps({"gaps": gaps, "same": same}, indent=0))
    for name, (kind, op) in gaps.items():
        print(f"[{kind}] ({op}) {name}")


if __name__ == "__main__":
    main(sys.argv[1:])

"""Machine code of every kernel of a training for other processors and systems: python tests/method/kernels/lowering.py

In a process that optimises nothing, a small training calls every kernel. Their LLVM code is then optimised and compiled
by llvmlite for each of TARGETS. Nothing of it is run: what is shown is that every kernel can be compiled there, and
which functions of the system it calls.
"""

import json
import os
import re
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

import llvmlite.binding as llvm

TARGETS = {  # triple, processor
    "apple-m1": ("arm64-apple-macosx13.0", "apple-m1"),
    "neoverse-n1": ("aarch64-unknown-linux-gnu", "neoverse-n1"),
    "x86-64-v2": ("x86_64-unknown-linux-gnu", "x86-64-v2"),
    "x86-64-v3": ("x86_64-unknown-linux-gnu", "x86-64-v3"),
    "x86-64-v4": ("x86_64-unknown-linux-gnu", "x86-64-v4"),
    "windows": ("x86_64-pc-windows-msvc", "x86-64-v3"),
    "intel mac": ("x86_64-apple-macosx13.0", "x86-64-v2"),
}
# Numba supplies what begins with NRT, numba or Py; the others are of the C library, on every system.
SUPPLIED = re.compile(r"(NRT_|numba_|Py|_Py|\.numba|_ZN)")
LIBRARY = {
    "ceil", "ceilf", "floor", "floorf", "cos", "cosf", "exp", "expf", "fmod", "fmodf", "log", "logf", "log2", "log2f",
    "pow", "powf", "sin", "sinf", "sqrt", "sqrtf", "memset", "memcpy", "memmove", "memcmp", "free", "malloc", "abort",
}  # fmt: skip
FLOAT_OF_LIBRARY = re.compile(r"llvm\.(exp|log|log2|pow|sin|cos)\.f(32|64)")
CALLS_ALL = """
import gc, json, sys, warnings
warnings.simplefilter("ignore")  # without optimisation no kernel can be kept
from numba.core.dispatcher import Dispatcher
from endotsr.config import PAPER
from endotsr.training.fitting.compile_ahead import rehearse
rehearse(PAPER)
found = {}
for kernel in (k for k in gc.get_objects() if isinstance(k, Dispatcher)):
    if kernel.py_func.__module__.startswith("endotsr"):
        for number, (signature, text) in enumerate(kernel.inspect_llvm().items()):
            found[f"{kernel.py_func.__module__}.{kernel.py_func.__name__} {number}"] = text
json.dump(found, open(sys.argv[1], "w", encoding="utf-8"))
"""


def kernels() -> dict[str, str]:
    """LLVM code, not optimised, of every kernel that a training calls, by name and number of its signature."""
    with tempfile.TemporaryDirectory() as folder:
        plain = {"NUMBA_OPT": "0", "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", "NUMBA_CACHE_DIR": folder}
        file = Path(folder) / "kernels.json"
        subprocess.run([sys.executable, "-c", CALLS_ALL, str(file)], env=os.environ | plain, check=True)
        return json.loads(file.read_text(encoding="utf-8"))


def machine_of(target: str) -> llvm.TargetMachine:
    """The code generator of a target. Raises RuntimeError if this build of LLVM lacks it."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    triple, processor = TARGETS[target]
    return llvm.Target.from_triple(triple).create_target_machine(cpu=processor, opt=3, reloc="pic", codemodel="small")


def compiled(text: str, machine: llvm.TargetMachine) -> bytes:
    """The object file of a kernel. Raises RuntimeError of LLVM."""
    text = re.sub(r"^target (triple|datalayout) = .*$", "", text, flags=re.MULTILINE)
    module = llvm.parse_assembly(text)
    module.triple, module.data_layout = machine.triple, str(machine.target_data)
    tuning = llvm.create_pipeline_tuning_options(speed_level=3)
    tuning.loop_vectorization = tuning.slp_vectorization = True
    builder = llvm.create_pass_builder(machine, tuning)
    builder.getModulePassManager().run(module, builder)
    return machine.emit_object(module)


def called(text: str) -> set[str]:
    """Functions outside the kernel, those of LLVM that become calls of the C library included."""
    declared = set(re.findall(r"^declare .*?@\"?([\w.$]+)\"?\(", text, re.MULTILINE))
    mathematical = {m[1] + ("f" if m[2] == "32" else "") for m in FLOAT_OF_LIBRARY.finditer(text)}
    return {name for name in declared if not name.startswith("llvm.") and not SUPPLIED.match(name)} | mathematical


def main() -> int:
    """The command."""
    texts = kernels()
    for target in TARGETS:
        machine = machine_of(target)
        size = sum(len(compiled(text, machine)) for text in texts.values())
        print(f"{target:12} {len(texts)} kernels, {size / 1e3:.0f} kB", flush=True)
    counts = Counter(name for text in texts.values() for name in called(text))
    print("they call", ", ".join(f"{name} ({count})" for name, count in sorted(counts.items())))
    return 0


if __name__ == "__main__":
    sys.exit(main())

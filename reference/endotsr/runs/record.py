"""The record of a run at its start: the content of run.json before the first iteration."""

from typing import Any

from endotsr.config import Config
from endotsr.runs.machine import machine, now, versions


def new_record(command: list[str], config: Config, threads: int, source: dict[str, Any]) -> dict[str, Any]:
    """The entries of run.json at the start of a run.

    command   command line of the run, one string a word
    threads   kernel threads in use
    source    `input_record` of the sequence
    """
    return {
        "status": "running",
        "command": command,
        "started": now(),
        "finished": None,
        "seconds": 0.0,
        "iterations_done": 0,
        "lambda_lap": None,
        "peak_memory_bytes": None,
        "seed": config.training.seed,
        "threads": threads,
        "versions": versions(),
        "machine": machine(),
        "input": source,
        "resumed": [],
    }

"""The runs of a sweep on an existing Dask cluster (`pip install 'endotsr[cluster]'`).

In: the address of a scheduler, jobs, and a function that returns their sequences. Out: outcomes as runs end, and None
between two polls. Each sequence is sent to the workers once. Dask reassigns the run of a lost worker; the new
worker continues it from its checkpoint. Run folders must be on a disk shared by all machines, and all workers must have
the same versions, because results depend on them. Both are checked.
"""

# Dask is an optional dependency.
# pyright: reportMissingImports=false

import contextlib
import hashlib
import logging
import secrets
import time
from collections import Counter
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import Any

from endotsr.clips.sequences.sequence import Sequence
from endotsr.errors import InputError
from endotsr.method.kernels.machine import usable_cores
from endotsr.studies.sweeps.execute import FAILED, Outcome, execute
from endotsr.studies.sweeps.jobs import STOP, Job
from endotsr.training.runs.machine import versions
from endotsr.untrusted.names import plain_line

TICK = 0.5  # seconds between two polls of the runs
PATIENCE = 15.0  # seconds to wait for the scheduler, and for its first worker
MOST_LOSSES = 3  # times that a run is resubmitted after all workers with its data were lost
TOKEN = "sweep.token"  # file in the folder of the sweep


def cluster_outcomes(
    address: str, jobs: list[Job], sequence_of: Callable[[Job], Sequence] | None, out: Path, threads: int | None
) -> Generator[Outcome | None, None, None]:
    """Execute the runs on the workers of a scheduler; KeyboardInterrupt stops all of them.

    sequence_of   None: each worker reads the sequence of its run from the shared disk
    threads       per run; default: the cores of a worker's machine divided by its number of workers
    Raises:       InputError of one line if the scheduler does not answer or is lost, or if a worker is unusable.
    """
    out = Path(out).absolute()
    with _connected(address) as client:
        (out / STOP).unlink(missing_ok=True)
        _refuse_workers(client, out)
        try:
            yield from _outcomes(client, jobs, sequence_of, out, threads)
        except BaseException:
            with contextlib.suppress(OSError):
                (out / STOP).touch()  # the runs poll for it and stop
            raise


def _outcomes(
    client: Any, jobs: list[Job], sequence_of: Callable[[Job], Sequence] | None, out: Path, threads: int | None
) -> Generator[Outcome | None, None, None]:
    sent, losses = _Sent(client, sequence_of), Counter[str]()
    running = {_submitted(client, job, sent, out, threads): job for job in jobs}
    while running:
        if client.status not in ("running", "newly-created", "connecting"):
            raise InputError("the Dask scheduler has ended; start it again: the same command continues")
        for future in [future for future in running if future.done()]:
            job = running.pop(future)
            if future.status in ("cancelled", "lost") and losses[job.name] < MOST_LOSSES:
                losses[job.name] += 1
                sent.forget(job)
                running[_submitted(client, job, sent, out, threads)] = job
                continue
            yield _outcome(job, future)
        yield None
        time.sleep(TICK)


class _Sent:
    """Sequences sent to the workers, by `Job.input_key`."""

    def __init__(self, client: Any, sequence_of: Callable[[Job], Sequence] | None) -> None:
        self._client, self._sequence_of = client, sequence_of
        self._found: dict[str, object] = {}

    def of(self, job: Job) -> Any:
        """The sequence of a job as a future; the first call sends it to every worker. None: workers read it."""
        if self._sequence_of is None:
            return None
        if job.input_key not in self._found:
            sequence = self._sequence_of(job)
            self._found[job.input_key] = self._client.scatter(sequence, broadcast=True, hash=False)
        return self._found[job.input_key]

    def forget(self, job: Job) -> None:
        """Send the sequence again next time: the workers that held it are lost."""
        self._found.pop(job.input_key, None)


def _submitted(client: Any, job: Job, sent: _Sent, out: Path, threads: int | None) -> Any:
    on_host = Counter(_host(worker) for worker in client.nthreads())
    key = f"{job.name}-{secrets.token_hex(4)}"
    return client.submit(
        _work, job, sent.of(job), str(out), _fingerprint(), dict(on_host), threads, key=key, pure=False
    )


def _work(
    job: Job,
    sequence: Sequence | None,
    out: str,
    expected: dict[str, str],
    on_host: dict[str, int],
    threads: int | None,
) -> Outcome:
    """On a worker: one run."""
    from distributed import get_worker

    worker = get_worker()
    if wrong := _difference(_fingerprint(), expected):
        return Outcome(job.name, FAILED, f"worker {worker.address}: {wrong}", ends_sweep=True)
    chosen = threads or max(1, usable_cores() // on_host.get(_host(worker.address), 1))
    return execute(job, chosen, sequence, _StopFile(Path(out) / STOP))


def _host(address: str) -> str:
    """The machine of `tcp://machine:port`."""
    return address.split("://")[-1].rsplit(":", 1)[0]


class _StopFile:
    """Whether a file exists; checked at most once per second."""

    def __init__(self, file: Path) -> None:
        self._file, self._looked = file, 0.0

    def __call__(self) -> bool:
        if time.monotonic() - self._looked < 1.0:
            return False
        self._looked = time.monotonic()
        return self._file.exists()


def _outcome(job: Job, future: Any) -> Outcome:
    if future.status == "finished":
        return future.result()
    if future.status in ("cancelled", "lost"):
        return Outcome(job.name, FAILED, f"the workers that held its sequence were lost {MOST_LOSSES + 1} times")
    error = future.exception()
    return Outcome(job.name, FAILED, plain_line(f"{type(error).__name__}: {error}"))


@contextlib.contextmanager
def _connected(address: str) -> Iterator[Any]:
    """A `distributed.Client` of the scheduler, with Dask's logging suppressed."""
    try:
        import distributed
    except ImportError:
        raise InputError("--scheduler: Dask is not installed; run `pip install 'endotsr[cluster]'`") from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, TypeError):
        raise InputError(
            f"--scheduler {address}: no Dask scheduler answers; use the address of a running one, such as "
            "tcp://127.0.0.1:8786 (`dask scheduler` prints it)"
        ) from None
    try:
        yield client
    finally:
        with contextlib.suppress(Exception):  # the scheduler may have ended
            client.close(timeout=5)


def _refuse_workers(client: Any, out: Path) -> None:
    """Raises InputError without a worker, or for one with other versions, several threads or no shared disk."""
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError:
        raise InputError("--scheduler: no workers; start some with `dask worker ADDRESS --nthreads 1`") from None
    for worker, count in client.nthreads().items():
        if count != 1:
            raise InputError(f"worker {worker}: has {count} threads; use --nthreads 1")
    token, expected = secrets.token_hex(8), _fingerprint()
    (out / TOKEN).write_text(token, encoding="ascii", newline="\n")
    for worker, found in client.run(_seen, str(out / TOKEN), on_error="return").items():
        if isinstance(found, BaseException):
            raise InputError(f"worker {worker}: cannot load endotsr: {plain_line(repr(found))}; use {expected}")
        if wrong := _difference(found[0], expected):
            raise InputError(f"worker {worker}: {wrong}")
        if found[1] != token:
            raise InputError(f"worker {worker}: cannot read {out}; use an --out on a disk shared by all machines")
    (out / TOKEN).unlink(missing_ok=True)


def _seen(token: str) -> tuple[dict[str, str], str]:
    """On a worker: its versions, and the token that it reads ("" without access)."""
    try:
        return _fingerprint(), Path(token).read_text(encoding="ascii")
    except OSError:
        return _fingerprint(), ""


def _fingerprint() -> dict[str, str]:
    """The versions that results depend on, and a digest of this package's sources."""
    import endotsr

    digest, package = hashlib.sha256(), Path(endotsr.__file__).parent
    for file in sorted(package.rglob("*.py")):
        digest.update(file.relative_to(package).as_posix().encode() + file.read_bytes())
    return versions() | {"endotsr": endotsr.__version__, "sources": digest.hexdigest()[:12]}


def _difference(found: dict[str, str], expected: dict[str, str]) -> str:
    """The differing versions as text; "" if there are none."""
    wrong = [name for name in expected if found.get(name) != expected[name]]
    shown = ", ".join(f"{name} {found.get(name, 'is missing')} (here {expected[name]})" for name in wrong)
    return f"has other versions: {shown}; use those of this machine" if wrong else ""

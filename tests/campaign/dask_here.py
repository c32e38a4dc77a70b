"""A dask cluster on this machine: scheduler and workers as processes of their own."""

import os
import signal
import socket
import subprocess
import sys
from contextlib import ExitStack, contextmanager, suppress


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


@contextmanager
def dask(*args, **kw):
    """A process of dask's command line, ended at the end."""
    with subprocess.Popen(
        [sys.executable, "-m", "distributed.cli." + args[0], *map(str, args[1:])],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True, **kw,
    ) as process:  # fmt: skip
        try:
            yield process
        finally:
            with_children(process, signal.SIGTERM)
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                with_children(process, signal.SIGKILL)


def with_children(process, number):
    with suppress(ProcessLookupError):
        os.killpg(process.pid, number)


@contextmanager
def cluster(tmp_path, *, workers=2, **kw):
    """A scheduler and workers in processes of their own: address, (scheduler, *workers); `kw` for the workers."""
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"
    worker = ("dask_worker", address, "--nthreads", "1", "--no-dashboard", "--local-directory", tmp_path / "dask")
    with ExitStack() as stack:
        scheduler = stack.enter_context(dask("dask_scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard"))
        yield address, (scheduler, *(stack.enter_context(dask(*worker, **kw)) for _ in range(workers)))

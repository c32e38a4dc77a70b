"""Commands without their imports: `python -m tests.forked SOCKET` has imported all, and forks for each command.

A command has the arguments, folder, environment and streams of the program that calls it: `CALL`, with the socket's
path and then the arguments. What only a new process shows, `cli/test_processes.py` has.
"""

import atexit
import gc
import importlib
import json
import os
import pkgutil
import runpy
import signal
import socket
import subprocess
import sys
import threading
import traceback
from contextlib import contextmanager, suppress

CALL = """
import json, os, sys
from _socket import AF_UNIX, SCM_RIGHTS, SOCK_SEQPACKET, SOL_SOCKET, socket
call = socket(AF_UNIX, SOCK_SEQPACKET)
call.connect(sys.argv[1])
streams = b"".join(i.to_bytes(4, sys.byteorder) for i in range(3))
call.sendmsg([json.dumps([sys.argv[2:], os.getcwd(), dict(os.environ)]).encode()], [(SOL_SOCKET, SCM_RIGHTS, streams)])
os._exit((call.recv(1) or b"\\x01")[0])
"""


@contextmanager
def forking(path, environment):
    """Within the block, a process that began with `environment` serves calls at the socket `path`; on Linux alone."""
    if sys.platform != "linux":  # elsewhere libraries do not survive a fork
        yield ""
        return
    command = [sys.executable, "-m", "tests.forked", str(path)]
    with subprocess.Popen(command, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE) as process:
        try:
            assert process.stdout.read(1), "it cannot import all"
            yield str(path)
        finally:
            process.terminate()


def serve(path):
    import aqualog

    for module in pkgutil.walk_packages(aqualog.__path__, "aqualog."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    gc.freeze()
    signal.signal(signal.SIGCHLD, _clear)
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as server:
        server.bind(path)
        server.listen()
        os.write(1, b"\n")
        while True:
            call, _ = server.accept()
            with call:
                if os.fork() == 0:
                    answer(call)


def _clear(*_):
    """What has answered leaves its processor time to this process."""
    with suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass


def answer(call):
    """Let another process run the command: what waits for its streams to be closed goes on when it has ended."""
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    said, streams, *_ = socket.recv_fds(call, 1 << 20, 3)
    pid = os.fork()
    if pid == 0:
        call.close()
        os._exit(run(*json.loads(said), streams))
    _, status = os.waitpid(pid, 0)
    for stream in (*streams, 0, 1, 2):
        os.close(stream)
    call.send(bytes([os.waitstatus_to_exitcode(status) % 256]))
    os._exit(0)


def run(arguments, folder, environment, streams):
    """Exit code of `python -m aqualog ARGUMENTS`, which ends with all but the removal of its modules."""
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        os.close(stream)
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    sys.argv = ["aqualog", *arguments]
    code = 0
    try:
        runpy.run_module("aqualog", run_name="__main__", alter_sys=True)
    except SystemExit as end:
        code = end.code or 0
    except BaseException:
        traceback.print_exc()
        code = 1
    threading._shutdown()
    atexit._run_exitfuncs()
    sys.stdout.flush()
    return code


if __name__ == "__main__":
    serve(sys.argv[1])

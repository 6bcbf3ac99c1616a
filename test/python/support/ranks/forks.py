"""Ranks that are forks of one process which has imported PyTorch: its import takes 1.5 s of CPU.

`Forks().start(command, environment, file)` is like `subprocess.Popen` with output into a file. The
process that forks is this program; its children run the command's program as Python would.
"""

import contextlib
import json
import os
import runpy
import signal
import socket
import subprocess
import sys
import threading

_MOST = 1 << 17


class Forks:
    """The process that forks, on one end of a socket."""

    def __init__(self):
        self._socket, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._lock = threading.Lock()
        command = [sys.executable, __file__, str(other.fileno())]
        self._process = subprocess.Popen(command, pass_fds=[other.fileno()])
        other.close()

    def start(self, command, environment, file):
        """Starts `[python, program, *arguments]` with output into a file."""
        request = {"argv": command[1:], "environment": environment}
        return Forked(self, self.ask(request, [file.fileno()]))

    def ask(self, request, files=()):
        """Sends a request; gives the answer."""
        with self._lock:
            socket.send_fds(self._socket, [json.dumps(request).encode()], files)
            return json.loads(self._socket.recv(_MOST))

    def close(self):
        """Ends the process; its children go on."""
        self._socket.close()
        self._process.wait()


class Forked:
    """A child of the process that forks, with what `launcher` uses of `subprocess.Popen`."""

    def __init__(self, forks, pid):
        self._forks, self.pid, self.returncode = forks, pid, None

    def poll(self):
        """The exit code, negative for a signal, or None while it runs."""
        if self.returncode is None:
            self.returncode = self._forks.ask({"poll": self.pid})
        return self.returncode

    def kill(self):
        """Ends it."""
        if self.poll() is None:
            os.kill(self.pid, signal.SIGKILL)

    def wait(self):
        """Waits for its end; gives the exit code."""
        if self.returncode is None:
            self.returncode = self._forks.ask({"wait": self.pid})
        return self.returncode


def _serve(connection):
    """Answers until the other end is closed; in a child it gives what to run, else None."""
    while True:
        data, files, _, _ = socket.recv_fds(connection, _MOST, 1)
        if not data:
            return None
        request = json.loads(data)
        if "argv" in request:
            pid = os.fork()
            if pid == 0:
                connection.close()
                for stream in (1, 2):
                    os.dup2(files[0], stream)
                os.close(files[0])
                os.environ.clear()
                os.environ.update(request["environment"])
                return request["argv"]
            os.close(files[0])
            answer = pid
        elif "poll" in request:
            pid, status = os.waitpid(request["poll"], os.WNOHANG)
            answer = os.waitstatus_to_exitcode(status) if pid else None
        else:
            answer = os.waitstatus_to_exitcode(os.waitpid(request["wait"], 0)[1])
        connection.send(json.dumps(answer).encode())


if __name__ == "__main__":
    with contextlib.suppress(ImportError):
        import torch.distributed  # noqa: F401
    sys.argv = _serve(socket.socket(fileno=int(sys.argv[1])))
    if sys.argv:
        path = os.environ.get("PYTHONPATH", "").split(os.pathsep)
        sys.path[:0] = [os.path.dirname(sys.argv[0]), *(one for one in path if one not in sys.path)]
        runpy.run_path(sys.argv[0], run_name="__main__")

"""Runs groups of calls in forked processes, so that a crash or a hang is one more answer."""

import faulthandler
import os
import pickle
import resource
import select
import signal
import struct
import sys
import tempfile

# A call that says nothing for so long hangs.
PATIENCE = 60.0
_ROOM = 3 << 30


def _child(output, task, start, folder):
    """Answers for the calls of a task from `start` on: ends the process.

    folder: where calls may write files.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    faulthandler.disable()
    os.chdir(folder)
    silent = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(silent, stream)
    used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + _ROOM, resource.RLIM_INFINITY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    sys.setrecursionlimit(400)

    def tell(*message):
        data = pickle.dumps(message)
        os.write(output, struct.pack("<I", len(data)) + data)

    try:
        task(start, tell)
        tell("done", None, None)
    except BaseException as error:
        tell("broken", None, f"{type(error).__name__}: {error}")
    os._exit(0)


def _messages(source):
    """The messages of a child, one at a time; None when it hangs."""
    data = b""
    while True:
        while len(data) < 4 or len(data) < 4 + struct.unpack("<I", data[:4])[0]:
            ready, _, _ = select.select([source], [], [], PATIENCE)
            if not ready:
                yield None
                return
            more = os.read(source, 1 << 16)
            if not more:
                return
            data += more
        size = struct.unpack("<I", data[:4])[0]
        yield pickle.loads(data[4 : 4 + size])
        data = data[4 + size :]


def run(task):
    """The result of `_run`, in a folder of its own that is gone afterwards."""
    with tempfile.TemporaryDirectory(prefix="warp-walk-") as folder:
        return _run(task, folder)


def _run(task, folder):
    """Failures of a task's calls as (call, what is wrong), and how many calls there were.

    `task(start, tell)` makes its calls from number `start` on; before call `n` it says
    `tell("call", n, text)` and, where the answer is wrong, `tell("wrong", n, text)` behind it.
    """
    failures, start, count = [], 0, 0
    while True:
        source, output = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(source)
            _child(output, task, start, folder)
        os.close(output)
        call, ended, hangs = (-1, "making the arguments"), False, False
        for message in _messages(source):
            if message is None:
                hangs = True
                break
            kind, number, text = message
            if kind == "call":
                call, count = (number, text), count + 1
            elif kind == "wrong":
                failures.append((call[1], text))
            elif kind == "broken":
                raise RuntimeError(f"the walk itself failed after {call[1]}: {text}")
            else:
                ended = True
        os.close(source)
        if hangs:
            os.kill(child, signal.SIGKILL)
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        if ended:
            return failures, count
        what = f"no answer in {PATIENCE:.0f} s" if hangs else f"the process ended with {status}"
        failures.append((call[1], what))
        if call[0] < 0:
            return failures, count
        start = call[0] + 1

"""Work in a process of its own, so that what never ends can be ended and a crash is an answer."""

import contextlib
import multiprocessing
import signal
import sys


class LostWorkError(Exception):
    """A question that got no answer.

    Attributes:
        status: 'timeout' or 'failed'.
    """

    def __init__(self, status, reason):
        super().__init__(reason)
        self.status = status


def _serve(pipe, prepare, arguments):
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        answer = prepare(*arguments)
    except Exception as error:
        pipe.send(f"{type(error).__name__}: {error}")
        return
    pipe.send("ready")
    while True:
        question = pipe.recv()
        if question is None:
            return
        pipe.send(answer(question))


class Remote:
    """Answers questions in a process that is started when it is needed.

    Args:
        prepare: function of a module, called there with `arguments`; returns the function that
            answers.
        limit: seconds that an answer may take.
    """

    def __init__(self, prepare, arguments, limit):
        self.prepare, self.arguments, self.limit = prepare, arguments, limit
        self.process = self.pipe = None

    def ask(self, question):
        """The answer.

        Raises:
            LostWorkError: it took too long, took the process down, or could not be prepared.
        """
        try:
            self._start()
            self.pipe.send(question)
            if self.pipe.poll(self.limit):
                return self.pipe.recv()
        except (EOFError, BrokenPipeError, ConnectionResetError):
            self.process.join(5)
            code = self.process.exitcode
            self.stop()
            reason = f"took its process down (exit status {code})"
            raise LostWorkError("failed", reason) from None
        self.stop()
        raise LostWorkError("timeout", f"did not end within {self.limit:g} s")

    def _start(self):
        if self.process is not None:
            return
        context = multiprocessing.get_context("spawn")
        self.pipe, other = context.Pipe()
        self.process = context.Process(
            target=_serve, args=(other, self.prepare, self.arguments), daemon=True
        )
        # A worker imports what it needs by name; the parent's own main module
        # is none of its business and may start a report itself.
        main = sys.modules["__main__"]
        hidden = {name: main.__dict__.pop(name, None) for name in ("__file__", "__spec__")}
        main.__spec__ = None
        try:
            self.process.start()
        finally:
            main.__dict__.update({k: v for k, v in hidden.items() if v is not None})
        other.close()
        answer = self.pipe.recv()
        if answer != "ready":
            self.stop()
            raise LostWorkError("failed", answer)

    def stop(self):
        """End the process, at once if it does not answer."""
        if self.process is None:
            return
        process, pipe, self.process, self.pipe = self.process, self.pipe, None, None
        with contextlib.suppress(OSError, ValueError):
            pipe.send(None)
        process.join(0.5 if process.exitcode is None else 0.0)
        if process.is_alive():
            process.kill()
            process.join(5)
        pipe.close()

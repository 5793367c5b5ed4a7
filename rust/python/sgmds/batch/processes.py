"""Worker processes on this machine. One that dies takes nothing with it but the pair it was at."""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
import threading
from collections import deque
from collections.abc import Iterable, Iterator
from multiprocessing import resource_tracker
from multiprocessing.connection import wait
from typing import Any

from .work import Outcome, Settings, Task, Worker, failure

ATTEMPTS = 2
"""How often a pair is given to a worker that then dies, before the pair is blamed."""


def run(tasks: Iterable[Task], jobs: int, settings: Settings) -> Iterator[tuple[Task, Outcome]]:
    """Outcomes in the order in which they come; tasks are taken only as fast as they are done."""
    coming = iter(tasks)
    again: deque[Task] = deque()
    deaths: dict[int, int] = {}
    idle: list[_Process] = []
    busy: dict[Any, tuple[_Process, Task]] = {}
    try:
        while True:
            while len(busy) < jobs and (task := again.popleft() if again else next(coming, None)):
                process = idle.pop() if idle else _Process(settings)
                process.begin(task)
                busy[process.pipe] = process, task
            if not busy:
                return
            for pipe in wait(list(busy)):
                process, task = busy.pop(pipe)
                outcome = process.outcome()
                if outcome is not None:
                    idle.append(process)
                    yield task, outcome
                    continue
                died = process.end()
                deaths[task.number] = deaths.get(task.number, 0) + 1
                if deaths[task.number] < ATTEMPTS:
                    again.append(task)
                else:
                    yield task, Outcome(failure(f"the worker process ended each time, {died}"))
    finally:
        for process in (*idle, *(process for process, _ in busy.values())):
            process.end()


class _Process:
    """A process of its own, told one task at a time through a pipe."""

    def __init__(self, settings):
        # A fork would copy the threads' locks in whatever state they are.
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self._process = context.Process(target=serve, args=(theirs, settings), daemon=True)
        with _interrupts_held_back():
            self._process.start()
        theirs.close()

    def begin(self, task):
        try:
            self.pipe.send(task)
        except OSError:
            # It died meanwhile, which `outcome` finds out.
            pass

    def outcome(self) -> Outcome | None:
        """What came back, None when the process died."""
        try:
            return self.pipe.recv()
        except (EOFError, OSError):
            return None

    def end(self) -> str:
        """Stops the process, and says how it ended."""
        self.pipe.close()
        self._process.join(timeout=0.5)
        if self._process.is_alive():
            self._process.terminate()
        self._process.join()
        code = self._process.exitcode or 0
        return f"by signal {-code} (out of memory?)" if code < 0 else f"with status {code}"


@contextlib.contextmanager
def _interrupts_held_back():
    """Ctrl-C is heard at the end of the block; a process begun in it never hears it."""
    if not hasattr(signal, "pthread_sigmask") or threading.current_thread() is not threading.main_thread():
        yield
        return
    # Which the first process begins, and which lets interrupts through again.
    resource_tracker.ensure_running()
    interrupts = []
    # Any thread of another library may take the signal, so blocking it in this one, which the new process
    # inherits, is not enough.
    heard = signal.signal(signal.SIGINT, lambda *_: interrupts.append(True))
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        signal.signal(signal.SIGINT, heard)
    if interrupts:
        raise KeyboardInterrupt


def serve(pipe, settings):
    """What a worker process does until the pipe is closed."""
    # Ctrl-C is for the process that the user started; that one ends us.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    worker = Worker(settings)
    while True:
        try:
            task = pipe.recv()
        except (EOFError, OSError):
            # Closed, perhaps before everything was sent that is waited for.
            return
        outcome = worker.match(task)
        try:
            pipe.send(outcome)
        except OSError:
            # Nobody is there any more to hear of it.
            return

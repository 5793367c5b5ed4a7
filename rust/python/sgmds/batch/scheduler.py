"""Workers of a dask scheduler, on as many machines as it has.

Each shape is a preparation task, each pair a task that depends on its two shapes' preparations. Files, cache
and maps are read and written by the workers, so they see the same folders; the results that travel are short
records. A worker that dies has its tasks given to others by the scheduler.
"""

from __future__ import annotations

import asyncio
import functools
import ipaddress
from collections.abc import Iterable, Iterator

from ..errors import ArgumentError, SgmdsError
from .work import Outcome, Settings, Task, Worker, failure

CONNECT_SECONDS = 20
ENCRYPTED = ("tls", "wss")
"""Protocols of dask that encrypt and, with certificates as docs/batch.md shows, let nobody else in."""
WINDOW = 8
"""Pairs under way per thread of the workers: enough to keep them busy, few enough for flat memory."""


def check_address(address: str, insecure: bool) -> None:
    """Raises `ArgumentError` for no address, and for one in the clear of another machine, unless `insecure`.

    Tasks and results of dask are pickles: whoever can send to a scheduler, a worker or a client runs programs
    there.
    """
    protocol, separator, place = address.partition("://")
    if not separator:
        protocol, place = "tcp", address
    if not place.strip():
        raise ArgumentError(f"a scheduler's address is like tls://HOST:8786, got {address!r}")
    if insecure or protocol in ENCRYPTED or protocol == "inproc":
        return
    host = place.rpartition(":")[0] if place.rpartition(":")[2].isdecimal() else place
    host = host.strip("[]")
    try:
        is_own = ipaddress.ip_address(host).is_loopback
    except ValueError:
        is_own = host == "localhost"
    if not is_own:
        raise ArgumentError(
            f"{address}: is not encrypted, and whoever reaches it can run programs on all its machines: "
            "use a tls:// address as docs/batch.md shows, or give --insecure in a network that you trust"
        )


def run(tasks: Iterable[Task], address: str, settings: Settings) -> Iterator[tuple[Task, Outcome]]:
    """Outcomes in the order in which they come; tasks are submitted only as fast as they are done.

    Raises
    ------
    SgmdsError
        When there is no scheduler at `address`, or it is lost on the way.
    """
    from distributed import CancelledError, Client, KilledWorker, as_completed

    try:
        # A client that cannot be made waits, and tells of itself on standard error, when it is forgotten.
        asyncio.run(_reach(address))
        client = Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
    except Exception as error:
        # No answer, none that is understood, certificates that are missing or do not fit: each has its own.
        raise SgmdsError(f"no scheduler answers at {address}: {error}") from error
    with client:
        prepared = {}
        under_way = {}
        coming = iter(tasks)
        finished = as_completed(loop=client.loop)

        def submit(task):
            for path in (task.source, task.target):
                if path not in prepared:
                    prepared[path] = client.submit(
                        _prepare, settings, path, pure=False, key=f"prepare-{path}"
                    )
            future = client.submit(
                _match,
                settings,
                task,
                prepared[task.source],
                prepared[task.target],
                key=f"match-{task.number}-{task.source.name}-{task.target.name}",
                pure=False,
            )
            under_way[future.key] = task
            finished.add(future)

        def fill():
            # Counted anew each time, because workers come and go.
            threads = sum(client.nthreads().values())
            while len(under_way) < WINDOW * max(threads, 1) and (task := next(coming, None)):
                submit(task)

        fill()
        for future in finished:
            task = under_way.pop(future.key)
            try:
                outcome = future.result()
            except CancelledError as error:
                raise SgmdsError(f"the scheduler at {address} was lost: start it and use --resume") from error
            except KilledWorker as error:
                outcome = Outcome(failure("each worker that tried died"), notes=[str(error)])
            except Exception as error:
                # Whatever a worker could not even begin, for example because it lacks this package.
                outcome = Outcome(failure(f"unexpected {type(error).__name__}: {error}"))
            yield task, outcome
            fill()


async def _reach(address: str) -> None:
    """Connects and lets go, or raises: for a name that is none, no answer, missing certificates."""
    from distributed import Security
    from distributed.comm import connect

    certificates = Security().get_connection_args("client")
    comm = await connect(address, timeout=CONNECT_SECONDS, **certificates)
    await comm.close()


@functools.lru_cache(maxsize=1)
def _worker(threads, cache, cache_limit, options) -> Worker:
    """The one of this process, made anew when another run begins."""
    return Worker(Settings(dict(options), threads, cache, cache_limit))


def _worker_for(settings: Settings) -> Worker:
    options = tuple(sorted(settings.options.items()))
    return _worker(settings.threads, settings.cache, settings.cache_limit, options)


def _prepare(settings, path):
    _worker_for(settings).prepare(path)


def _match(settings, task, *_prepared):
    return _worker_for(settings).match(task)

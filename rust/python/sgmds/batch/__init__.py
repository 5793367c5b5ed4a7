"""Many pairs, unattended: from a manifest to maps, distance matrices and a picture of them.

    manifest.py    which shapes, which pairs, where to
    work.py        one pair: files in, map and record out
    processes.py   worker processes on this machine
    scheduler.py   workers of a dask scheduler, on any machine
    journal.py     what is done, so that a run can be taken up
    report.py      CSV, JSON and picture, the same for the same work however it was interrupted
    run.py         all of it together

`import sgmds` does not need this package; the picture and the progress bar need the extra "tools", a
scheduler needs "batch".
"""

from .run import run

__all__ = ["run"]

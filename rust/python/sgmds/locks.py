"""Locks on files between processes, which the system lets go of when a process ends in whatever way."""

import sys

if sys.platform == "win32":
    import msvcrt

    def try_lock(file) -> bool:
        """Locks an open file until it is closed; false when somebody else holds it."""
        file.seek(0)
        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        except PermissionError:
            return False
        return True

else:
    import fcntl

    def try_lock(file) -> bool:
        """Locks an open file until it is closed; false when somebody else holds it."""
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True

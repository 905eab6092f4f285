"""Threads that wait for processes."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

__all__ = ["waiting_threads"]


@contextmanager
def waiting_threads(count: int) -> Iterator[ThreadPoolExecutor]:
    """A pool of ``count`` threads for jobs that run in processes of their own.

    After an error or an interrupt, jobs that have not begun are not begun any more.
    """
    with ThreadPoolExecutor(max_workers=count) as pool:
        try:
            yield pool
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise

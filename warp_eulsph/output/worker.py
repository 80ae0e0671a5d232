"""One background thread that writes in order, so that the run need not wait for the disk."""

import queue
import threading
from collections.abc import Callable

# Jobs that may wait: each holds a frame in memory, and a disk that is slower than the run must slow it down.
WAITING = 4


class Worker:
    """Does jobs one after the other. After one has failed the others are dropped, and the error is raised at ``check``.

    What comes later in the order may rely on what came before: no checkpoint follows a snapshot that was lost.
    """

    def __init__(self) -> None:
        self._jobs: queue.Queue[Callable[[], object] | None] = queue.Queue(WAITING)
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._work, name="run writer", daemon=True)
        self._thread.start()

    def submit(self, job: Callable[[], object]) -> None:
        """Queue a job; waits while too many are waiting.

        Raises:
            Exception: what an earlier job raised.
        """
        self.check()
        self._jobs.put(job)

    def check(self) -> None:
        """Raise what a job raised, if any did."""
        if self._error is not None:
            raise self._error

    def drain(self) -> None:
        """Wait until all jobs are done or dropped."""
        self._jobs.join()

    def close(self) -> None:
        """Do what is queued and end the thread; raises nothing."""
        if self._thread.is_alive():
            self._jobs.put(None)
            self._thread.join()

    def _work(self) -> None:
        while (job := self._jobs.get()) is not None:
            try:
                if self._error is None:
                    job()
            except BaseException as error:  # handed to the run, which raises it
                self._error = error
            finally:
                self._jobs.task_done()

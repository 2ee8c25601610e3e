"""Workers on this machine's cores: a thread for each, which gives jobs to a run server."""

import queue
import threading
from collections.abc import Generator, Sequence
from pathlib import Path
from types import TracebackType

from handover.cosim.exceptions import one_line
from handover.scenarios.runs.campaign.run_servers import JobRunner, end_runners
from handover.scenarios.runs.campaign.worker_pool import JobResult, RunJob, cores, marked


class LocalPool:
    """Run servers of this process, started with their first job. They end with it, however it ends.

    They receive no Ctrl-C: this process does, and ends them.

    Args:
        workers: how many; None for one for each core that this process may use.
    """

    def __init__(self, workers: int | None) -> None:
        self.workers = workers or cores()
        """How many jobs run at the same time."""
        self._runners = [JobRunner() for _ in range(self.workers)]

    def __enter__(self) -> "LocalPool":
        """Return itself."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """End the run servers."""
        self._end()

    def check(self, folder: Path) -> None:
        """Check that a folder can be written to.

        Raises:
            RecordNotWritten: it cannot.
        """
        with marked(folder):
            pass

    def run_jobs(self, jobs: Sequence[RunJob]) -> Generator[JobResult, None, None]:
        """Give each job to a run server; yield the results as they come.

        If the iteration is left before its end, runs under way are ended and leave nothing.
        """
        waiting: queue.SimpleQueue[RunJob] = queue.SimpleQueue()
        done: queue.SimpleQueue[JobResult] = queue.SimpleQueue()
        left = threading.Event()
        for job in jobs:
            waiting.put(job)

        def work(runner: JobRunner) -> None:
            while not left.is_set():
                try:
                    job = waiting.get_nowait()
                except queue.Empty:
                    return
                try:
                    done.put(runner.run(job, lambda: not left.is_set()))
                except Exception as e:  # a thread that ends without a result would be waited for without end
                    done.put(JobResult(name=job.name, lost=f"{type(e).__name__}: {one_line(e)}"))

        threads = [threading.Thread(target=work, args=(runner,), daemon=True) for runner in self._runners[: len(jobs)]]
        try:
            for thread in threads:
                thread.start()
            for _ in jobs:
                yield done.get()
        except BaseException:
            left.set()
            self._end()
            raise
        finally:
            for thread in threads:
                if thread.ident is not None:
                    thread.join()

    def _end(self) -> None:
        """End the run servers, and their runs; later jobs get others."""
        ended, self._runners = self._runners, [JobRunner() for _ in range(self.workers)]
        end_runners(ended)

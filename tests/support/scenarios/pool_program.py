"""A program that runs jobs in a worker pool, local or at an address, and prints the results; tests kill it."""

import pickle
import sys
from pathlib import Path

if __name__ == "__main__":
    from handover.scenarios.runs.campaign.cluster import connect_cluster
    from handover.scenarios.runs.campaign.pools import LocalPool

    jobs = pickle.loads(Path(sys.argv[1]).read_bytes())
    try:
        with connect_cluster(sys.argv[2]) if sys.argv[2:] else LocalPool(2) as pool:
            for result in pool.run_jobs(jobs):
                print(result.name, result.lost, flush=True)
    except KeyboardInterrupt:
        sys.exit(130)

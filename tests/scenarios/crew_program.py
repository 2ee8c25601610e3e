"""A program that gives orders to an embedded crew of two, one JSON line of answers each: to be killed meanwhile."""

import pickle
import sys
from pathlib import Path

if __name__ == "__main__":
    from scenarios.campaign.dask_crew import embedded_crew

    orders = pickle.loads(Path(sys.argv[1]).read_bytes())
    try:
        with embedded_crew(2) as crew:
            for answer in crew.carry_out(orders):
                print(answer.name, answer.lost, flush=True)
    except KeyboardInterrupt:
        sys.exit(130)

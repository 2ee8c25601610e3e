"""A program that gives orders to a crew, embedded or at an address, and prints the answers: to be killed meanwhile."""

import pickle
import sys
from pathlib import Path

if __name__ == "__main__":
    from handover.scenarios.campaign.local_cluster import crew_at, embedded_crew

    orders = pickle.loads(Path(sys.argv[1]).read_bytes())
    try:
        with crew_at(sys.argv[2]) if sys.argv[2:] else embedded_crew(2) as crew:
            for answer in crew.carry_out(orders):
                print(answer.name, answer.lost, flush=True)
    except KeyboardInterrupt:
        sys.exit(130)

"""Units that have to agree: interfaces and their solvers, iterated steps, values at the start."""

"""Writes rates, intervals and p-values for claims and tables."""


def told_rate(successes: int, n: int) -> str:
    """Return such as `11/15 (73 %)`."""
    return f"{successes}/{n} ({told_share(successes / n)})"


def told_share(share: float) -> str:
    """Return such as `73 %`."""
    return f"{100 * share:.0f} %"


def told_interval(low: float, high: float) -> str:
    """Return the interval of a rate such as `45 to 92 %`."""
    return f"{100 * low:.0f} to {told_share(high)}"


def told_p(p: float) -> str:
    """Return a p-value, such as `0.031` or `2e-12`."""
    return f"{p:.2g}"

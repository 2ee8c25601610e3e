"""Workers that cannot carry out a campaign."""


class BadCrew(ValueError):
    """A cluster that cannot be reached, is none, has no workers, or has workers that would give other numbers."""


class CrewLost(RuntimeError):
    """The cluster has gone while runs were under way. What has ended is kept."""

"""Two free-flyers and a person hand a large object over. [Fernandes2020] sec. 6.3."""

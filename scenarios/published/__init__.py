"""Published experiments: the campaigns behind papers' tables, and what came out beside what was published."""

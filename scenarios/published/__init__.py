"""Published experiments: campaigns that repeat papers' tables, with published values and verdicts beside ours."""

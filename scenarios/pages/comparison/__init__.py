"""Campaigns, or runs, beside each other: one table, one page, figures."""

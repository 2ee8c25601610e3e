"""What commands print of runs, campaigns, comparisons, claims and units, and as JSON."""

"""Report pages: one HTML file of a run or of a campaign that opens offline."""

"""Report pages of runs, and the parts that pages of campaigns share: one HTML file that opens offline."""

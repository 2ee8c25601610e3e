"""Campaigns: many runs of a scenario, on this machine's cores or on a Dask cluster."""

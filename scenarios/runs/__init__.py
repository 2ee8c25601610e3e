"""Runs, one and many: carried out, recorded in a folder, shown on a page."""

"""The folder of a run: written, read and checked; the one place where its summary is made."""

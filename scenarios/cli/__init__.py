"""The command `handover`: a file a command; what they print is in `summaries`."""

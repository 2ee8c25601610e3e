"""The command `handover`: a file a command."""

"""The command `handover`: a file a command, those of units or one robot in folders; what they print: `summaries`."""

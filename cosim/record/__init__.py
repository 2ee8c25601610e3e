"""Records of signals: written as they come, safe against the end of the process, in several formats."""

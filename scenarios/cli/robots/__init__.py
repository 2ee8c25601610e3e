"""Commands for one robot each; all others are for any."""
